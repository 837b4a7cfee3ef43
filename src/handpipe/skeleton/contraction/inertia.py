"""Moments of inertia of chains of bones: solid cylinders of bone and tissue (Albrecht 2003 §4.1.2).

The paper looks up the moments of up to three bones by their angles. The mass matrix of the whole tree holds
them all, with what a joint's motion does to the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.joint_tree import JointTree
from handpipe.skeleton.rig.twists import moving_bones

DENSITY = 1.1e-6  # kg/mm^3, of tissue
ENVELOPE = 4.0  # volume of a finger's segment over that of its bone


@dataclass(frozen=True)
class BoneMasses:
    """Masses of a rig's bones, each as six points that have the inertia of a solid cylinder.

    Parameters
    ----------
    rig : JointTree
        The rig.
    points : dict of str to array (6, 3)
        Neutral points in mm by bone.
    masses : dict of str to float
        Mass in kg of each of a bone's points.
    """

    rig: JointTree
    points: dict[str, Array]
    masses: dict[str, float]

    @staticmethod
    def of_rig(rig: JointTree) -> BoneMasses:
        """Bones with the tissue around them, from the neutral surfaces of the bones."""
        masses = {bone: ENVELOPE * DENSITY * abs(s.volume()) / 6 for bone, s in rig.surfaces.items()}
        return BoneMasses(rig, {bone: cylinder_points(s) for bone, s in rig.surfaces.items()}, masses)

    def matrix(self, angles: Array) -> Array:
        """Mass matrix (k, k) in kg mm^2 at angles (k,) in rad, in the order of `angle_names`.

        Its diagonal holds the moments of inertia of all that turns with a joint.
        """
        bones = moving_bones(self.rig, dict(zip(self.rig.angle_names, map(float, angles), strict=True)))
        total = np.zeros((len(angles), len(angles)))
        for name, bone in bones.items():
            places = bone.transform(self.points[name])
            rates = np.cross(bone.angular, places[:, None]) + bone.linear
            total += self.masses[name] * np.einsum("pki,pli->kl", rates, rates)
        return total


def cylinder_points(surface: Surface) -> Array:
    """Six points (6, 3) of equal mass with middle and inertia of the solid cylinder that a bone is taken for.

    Its axis is the longest extent of the vertices, its length that extent, its volume the bone's.
    """
    middle = surface.centroid()
    axes = np.linalg.svd(surface.vertices - surface.vertices.mean(axis=0), full_matrices=False)[2]
    length = float(np.ptp(surface.vertices @ axes[0]))
    radius = np.sqrt(ENVELOPE * abs(surface.volume()) / (np.pi * length))
    spreads = np.sqrt([length**2 / 12, radius**2 / 4, radius**2 / 4])  # of a solid cylinder
    offsets = np.sqrt(3.0) * spreads[:, None] * axes
    return np.concatenate([middle + offsets, middle - offsets])
