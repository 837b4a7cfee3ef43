"""Poses of the finger whose tissues slide: its body, and equilibria with figures of themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError, RigidTransform
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Sum
from handpipe.fem.solver import Equilibrium, Options
from handpipe.mesh.surfaces import Distance, Surface, barycentric_weights
from handpipe.synthetic.coupled import anatomy_file
from handpipe.synthetic.coupled.coupled_body import CoupledPose
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.phantom.phantom_finger import POSES, posture
from handpipe.synthetic.sliding.finger_bodies import FingerBodies, with_bones
from handpipe.synthetic.sliding.sliding_body import Interfaces, SlidingBody, follow

FAT, MUSCLE = Material(3.0, 0.45), Material(6.0, 0.48)  # kPa, Young's modulus
INTERFACES = Interfaces(distance=0.35, stiffness=5.0, suction=2.0, skin=Material(20.0, 0.45), thickness=1.0)
TENSION = 15.0  # kPa of a muscle at rest length with the MP joint flexed by 90 degrees
STEP = 12.0  # deg that a joint turns in a step
# mm, and shares of the forces: solves of whole poses
OPTIONS = Options(displacement_tolerance=1e-3, force_tolerance=1e-4, max_iterations=400, untangle=False)


def body_of(bodies: FingerBodies, order: int = 1) -> SlidingBody:
    """The finger's body, with linear or quadratic tets (order 1 or 2)."""
    materials = {"fat": FAT, **dict.fromkeys(bodies.anatomy.fibres, MUSCLE)}
    return SlidingBody(bodies.anatomy, bodies.bones, materials, INTERFACES, order=2 if order == 2 else 1)


def load_body(path: str | Path) -> SlidingBody:
    """The body of a file of the bodies' anatomy."""
    return body_of(with_bones(anatomy_file.load(path)))


def pose_at(body: SlidingBody, pose: str, share: float = 1.0) -> CoupledPose:
    """Bones, root at rest, and muscles' tensions at a share of the way from neutral to a pose."""
    target = posture(pose, 0)
    angles = {name: share * angle for name, angle in target.angles.items()}
    bones = Posture(target.joints, angles, RigidTransform.identity()).transforms()
    flexion = np.sin(angles["MP2_flexion"]) + 0.5 * np.sin(angles["MP2_abduction"])
    return CoupledPose(bones, dict.fromkeys(body.muscles, TENSION * max(float(flexion), 0.0)))


def settle(body: SlidingBody, pose: str, neutral: Array | None = None) -> Equilibrium:
    """The equilibrium of a pose, followed from the neutral one at x (n, 3), or from the bodies' rest shapes.

    Raises
    ------
    ConvergenceError
        If there is none without inverted tissue.
    """
    steps = max(int(np.ceil(max(map(abs, POSES[pose])) / STEP)), 1)
    motion = partial(pose_at, body, pose)
    return follow(body, motion, neutral, steps=steps, options=replace(OPTIONS, name=pose))


@dataclass(frozen=True)
class Checks:
    """Figures of an equilibrium about itself.

    Parameters
    ----------
    unbalanced : float
        Largest force in mN on a free node.
    gap : float
        Least distance in mm of surfaces that may touch.
    void : float
        Volume in mm^3 of the void between bodies and bones.
    inverted : int
        Inverted tets and quadrature points.
    volume_ratio : float
        Least volume relative to rest of a tet.
    """

    unbalanced: float
    gap: float
    void: float
    inverted: int
    volume_ratio: float


def checks(body: SlidingBody, pose: str, x: Array) -> Checks:
    """Figures of the equilibrium x (n, 3) of a pose.

    Raises
    ------
    InputError
        If surfaces intersect.
    """
    at = pose_at(body, pose)
    assert body.barrier is not None
    barrier = body.barrier.with_obstacle(body.bone_vertices(at.bones))
    if barrier.intersects(x):
        raise InputError(pose, "positions", "surfaces intersect", "Simulate the pose again")
    forces = Sum([*body.potentials(at), barrier]).gradient(x)
    free = ~body.fixed.reshape(-1, 3)
    bones = sum(bone.volume() for bone in body.bones.values())
    return Checks(
        float(np.linalg.norm(np.where(free, forces, 0.0), axis=1).max()),
        barrier.gap(x),
        body.void.volume(x) - bones,
        body.inverted(x),
        float(body.solid.volume_ratios(x).min()),
    )


def slides(body: SlidingBody, neutral: Array, x: Array) -> Mapping[str, Array]:
    """How far in mm each muscle's surface slid over the cavity's wall, from neutral (n, 3) to x (n, 3).

    At each node of the muscle's surface that is within reach of the wall in neutral and not attached: the
    distance along the wall of the place it had there from the node now.
    """
    wall = body.faces_of("fat")
    wall = wall[~np.isin(wall, body.outer).all(axis=1)]
    free = ~body.fixed.reshape(-1, 3)[:, 0]
    found = {}
    for name in body.muscles:
        nodes = np.unique(body.faces_of(name))
        nodes = nodes[free[nodes]]
        distance, triangle, place = Distance(Surface(neutral, wall)).closest(neutral[nodes])
        near = distance < 2.0 * INTERFACES.distance
        corners = wall[triangle[near]]
        weights = barycentric_weights(place[near], neutral[corners])
        then = np.einsum("kc,kcd->kd", weights, x[corners])
        between = x[nodes[near]] - then
        normal = np.cross(x[corners[:, 1]] - x[corners[:, 0]], x[corners[:, 2]] - x[corners[:, 0]])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = between - np.einsum("kd,kd->k", between, normal)[:, None] * normal
        found[name] = np.linalg.norm(along, axis=1)
    return found
