"""A finger of two bones with a hinge between them: positive angles bend it towards -z."""

from __future__ import annotations

from functools import cache

import numpy as np

from handpipe.core.layers import Frame
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig
from handpipe.tissues.fat.skin import Rigid, Skin

from .limb import capsule

BONE, FLESH, GAP = 3.0, 7.0, 0.5  # mm: radii, and half the joint's space
LIMITS = np.radians([[0.0, 90.0]])


def along(surface: Surface, shift: float) -> Surface:
    return surface.moved(surface.vertices + [shift, 0.0, 0.0])


@cache
def rig() -> Rig:
    still = Residual(np.zeros((2, 3)), *LIMITS.T)
    fit = JointFit(
        Axes(np.array([[0.0, 1.0, 0.0]]), (0,)), np.array([-2.0, 0, 0]), still, still, np.zeros((0, 1))
    )
    bone = capsule(BONE, 1.0, 14.0)
    shift = 7.0 + BONE + GAP
    surfaces = {"near": along(bone, -shift), "far": along(bone, shift)}
    return Rig("near", (RigJoint("hinge", "near", "far", ("hinge_flexion",), LIMITS, fit),), surfaces, {})


@cache
def skin() -> Skin:
    surface = capsule(FLESH, 1.6, 36.0)
    return Skin(surface, {"cut_end": Rigid("near", np.flatnonzero(surface.vertices[:, 0] < -20.0))})


def bent(degrees: float) -> Frame:
    angles = {"hinge_flexion": float(np.radians(degrees))}
    return Frame(f"bent{degrees:g}", angles, rig().bone_transforms(angles))
