"""Frames of three bones in a row whose skin and muscle follow known weights and a known corrective."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig

BONES = ("palm", "first", "second")
LIMITS = np.radians([[-20.0, 80.0]])


def ball(x: float) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=4.0)
    return Surface(np.asarray(mesh.vertices) + [x, 0, 0], np.asarray(mesh.faces))


def rig() -> Rig:
    """Bones along x; each joint turns about y half-way between two."""
    still, joints = Residual(np.zeros((2, 3)), *LIMITS.T), []
    for i, (parent, child) in enumerate(zip(BONES, BONES[1:], strict=False)):
        fit = JointFit(
            Axes(np.array([[0.0, 1, 0]]), (0,)),
            np.array([20.0 * i + 10, 0, 0]),
            still,
            still,
            np.zeros((0, 1)),
        )
        joints.append(RigJoint(child, parent, child, (f"{child}_bend",), LIMITS, fit))
    surfaces = {bone: ball(20.0 * i) for i, bone in enumerate(BONES)}
    return Rig("palm", tuple(joints), dict(reversed(surfaces.items())), {})  # in an order of their own


def tube(radius: float) -> Surface:
    mesh = trimesh.creation.cylinder(radius=radius, height=50.0, sections=12).subdivide().subdivide()
    turned = np.asarray(mesh.vertices) @ Rotation.from_rotvec([0, np.pi / 2, 0]).as_matrix().T
    return Surface(turned + [20, 0, 0], np.asarray(mesh.faces))


def known_weights(rest: np.ndarray) -> np.ndarray:
    """Weights (n, 3) that go over from bone to bone within 12 mm around each joint."""
    over = [np.clip((rest[:, 0] - x) / 12 + 0.5, 0, 1) for x in (10.0, 30.0)]
    return np.column_stack([1 - over[0], over[0] - over[0] * over[1], over[0] * over[1]])


def motions(angles: np.ndarray) -> list[RigidTransform]:
    """Of the bones at two angles in rad, in scipy's rotations alone."""
    found = [RigidTransform.identity()]
    for i, angle in enumerate(angles):
        about = RigidTransform.about(
            np.array([20.0 * i + 10, 0, 0]), Rotation.from_rotvec([0, angle, 0]).as_matrix()
        )
        found.append(found[-1] @ about)
    return found


def corrective(rest: np.ndarray, angles: np.ndarray, size: float) -> np.ndarray:
    """What is added in neutral: quadratic in the two angles in rad, smooth along the tube."""
    a, b = angles
    wave = np.sin(rest / 9.0)
    return size * (a * wave + b * b * np.cos(rest / 7.0) + a * b * wave[:, [2, 0, 1]])


def skinned(rest: np.ndarray, weights: np.ndarray, angles: np.ndarray, added: np.ndarray) -> np.ndarray:
    moved = [motion(rest + added) for motion in motions(angles)]
    return sum(w[:, None] * x for w, x in zip(weights.T, moved, strict=True))


def frame(name: str, angles: np.ndarray, size: float = 0.5):
    """A frame at two angles in rad, as a simulation would give it."""
    made, layers = rig(), {}
    bones = dict(zip(BONES, motions(angles), strict=True))
    layers["bones"] = {
        b: Shape(s.vertices, bones[b](s.vertices), s.triangles) for b, s in made.surfaces.items()
    }
    for layer, body, radius in (("muscles", "muscle", 5.0), ("fat", "skin", 8.0)):
        surface = tube(radius)
        x = surface.vertices
        moved = skinned(x, known_weights(x), angles, corrective(x, angles, size))
        layers[layer] = {body: Shape(x, moved, surface.triangles)}
    mesh = tube(4.0).vertices[:4]
    layers["fat"]["fat_mesh"] = Shape(mesh, mesh, np.array([[0, 1, 2, 3]]))
    return Frame(name, dict(zip(made.angle_names, map(float, angles), strict=True)), bones), layers


def random_frames(count: int, seed: int = 0, size: float = 0.5, upper: float = 80.0):
    """Frames at angles from -20 degrees to an upper one."""
    values = np.random.default_rng(seed).uniform(-20, upper, (count, 2))
    return [frame(f"random{i}", np.radians(v), size) for i, v in enumerate(values)]
