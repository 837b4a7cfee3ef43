"""A rig of five fingers, and the same kinematics once more in products of scipy's rotations alone."""

from __future__ import annotations

import numpy as np
from manufactured import bone, unit
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import FittedPose, RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig

# +x distal, +y radial, +z dorsal: a right hand. (joint, parent, child, angles, axes, centre, limits in deg)
FLEXION, ABDUCTION = [0.0, 1, 0], [0.0, 0, 1]
LENGTHS = {"proximal": 40.0, "middle": 25.0, "distal": 18.0}
KNUCKLES = {2: (66.0, 22.0, 0.0), 3: (68.0, 2.0, 1.0), 4: (64.0, -17.0, 0.0), 5: (57.0, -34.0, -3.0)}


def description():
    joints = [
        ("CMC1", "carpals", "metacarpal1", ("CMC1_flexion", "CMC1_abduction"),
         (unit([0.5, 0.3, 0.81]), unit(np.cross([0.5, 0.3, 0.81], [0.6, 0.8, 0.1]))),
         (5.0, 16.0, -6.0), ((-40, 45), (-30, 50))),
        ("MP1", "metacarpal1", "proximal1", ("MP1_flexion",), (unit([0.5, -0.3, 0.8]),),
         (34.0, 45.0, -14.0), ((-10, 60),)),
        ("IP1", "proximal1", "distal1", ("IP1_flexion",), (unit([0.5, -0.3, 0.8]),),
         (58.0, 62.0, -17.0), ((-25, 80),)),
    ]  # fmt: skip
    for digit, (x, y, z) in KNUCKLES.items():
        tilt = 0.05 * (digit - 3)
        hinge = unit([tilt, 1, 0.3 * tilt])
        aside = unit(np.cross(np.cross(hinge, [0.05, 0, 1]), hinge))
        parts = ("proximal", "middle", "distal")
        points = x + np.concatenate([[0], np.cumsum([LENGTHS[p] for p in parts])])
        parents = ("carpals", f"proximal{digit}", f"middle{digit}")
        for k, (name, part) in enumerate(zip(("MP", "PIP", "DIP"), parts, strict=True)):
            axes = (hinge, aside) if k == 0 else (hinge,)
            angles = tuple(f"{name}{digit}_{a}" for a in ("flexion", "abduction")[: len(axes)])
            limits = (((-20, 90), (-20, 20)), ((-5, 110),), ((-10, 80),))[k]
            centre = (points[k], y, z - 0.5 * k)
            joints.append((f"{name}{digit}", parents[k], f"{part}{digit}", angles, axes, centre, limits))
    return joints


DESCRIPTION = description()


def coefficients(name, dof):
    """Residual motions of a few degrees and half a millimetre at a radian: (rotation, translation)."""
    rng = np.random.default_rng(sum(map(ord, name)))
    k = {1: 2, 2: 5}[dof]
    return 0.04 * rng.normal(size=(k, 3)), 0.4 * rng.normal(size=(k, 3))


def _none(dof):
    return np.zeros((2 if dof == 1 else 5, 3)), np.zeros((2 if dof == 1 else 5, 3))


def tips(mirrored=False):
    """Finger tips in neutral, by digit."""
    out = {d: np.array([x + sum(LENGTHS.values()), y, z - 3]) for d, (x, y, z) in KNUCKLES.items()}
    out[1] = np.array([80.0, 75.0, -24.0])
    return {d: p * [1, -1, 1] if mirrored else p for d, p in out.items()}


def rig(residuals=True, mirrored=False, poses=()):
    """The rig as the project's classes hold it; its mirror image over y is a left hand.

    A mirrored turn is about the mirrored axis the other way, and so are residual rotations.
    """
    flip = np.array([1.0, -1.0, 1.0]) if mirrored else np.ones(3)
    joints = []
    for name, parent, child, angles, axes, centre, limits in DESCRIPTION:
        dof = len(axes)
        rotation, translation = coefficients(name, dof) if residuals else _none(dof)
        pseudo = -flip if mirrored else flip
        directions = np.array(axes) * pseudo
        lower, upper = np.radians(np.array(limits, float)).T  # residuals go on as tangents beyond
        fit = JointFit(
            Axes(directions, tuple(range(dof))),
            np.array(centre) * flip,
            Residual(rotation * pseudo, lower, upper),
            Residual(translation * flip, lower, upper),
            np.zeros((0, dof)),
        )
        joints.append(RigJoint(name, parent, child, angles, np.radians(np.array(limits, float)), fit))
    surfaces = {"carpals": _bone(np.array([0.0, 0, 0]), np.array([66.0, 4, 0]), 12.0, flip)}
    ends = tips()
    for name, _, child, _, _, centre, _ in DESCRIPTION:
        after = [np.array(d[5]) for d in DESCRIPTION if d[1] == child]
        end = after[0] if after else ends[int(name[-1])] + [0, 0, 3]
        surfaces[child] = _bone(np.array(centre), end, 4.0, flip)
    bare = Rig("carpals", tuple(joints), surfaces, {})
    scanned = {f"pose{i}": FittedPose(RigidTransform.identity(), dict(p)) for i, p in enumerate(poses)}
    return Rig(bare.root, bare.joints, bare.surfaces, scanned)


def _bone(start, end, radius, flip):
    """A bone-like surface from near `start` to near `end`."""
    shape = bone(10, 12)
    along = unit(end - start)
    aside = unit(np.cross([0.0, 0, 1], along))
    frame = np.column_stack([along, aside, np.cross(along, aside)])
    scale = np.array([0.45 * np.linalg.norm(end - start) / 18, radius / 5.4, radius / 5.4])
    surface = shape.moved(((shape.vertices * scale) @ frame.T + (start + end) / 2) * flip)
    return surface if surface.volume() > 0 else Surface(surface.vertices, surface.triangles[:, ::-1])


def relative(name, values, residuals=True):
    """Motion of a joint's child relative to its parent by the same formula, at values (dof,) in rad."""
    child = next(d[2] for d in DESCRIPTION if d[0] == name)
    names = next(d[3] for d in DESCRIPTION if d[0] == name)
    still = {n: 0.0 for d in DESCRIPTION for n in d[3]} | dict(zip(names, values, strict=True))
    shift, rotation = posed(np.zeros(3), child, still, residuals)
    return RigidTransform(rotation, shift)


def posed(point, child, angles, residuals=True):
    """Where a neutral point of a bone goes, and the bone's rotation: Eq. 2 joint by joint, from the child up.

    Angles within the range of the residuals only.
    """
    by_child = {d[2]: d for d in DESCRIPTION}
    x, rotation = np.array(point, float), np.eye(3)
    while child in by_child:
        name, parent, _, names, axes, centre, _ = by_child[child]
        q = np.array([angles[n] for n in names])
        turned = Rotation.identity()
        for axis, value in zip(axes, q, strict=True):
            turned = turned * Rotation.from_rotvec(value * axis)
        shift = np.zeros(3)
        if residuals:
            powers = [q[0], q[0] ** 2] if len(q) == 1 else [q[0], q[1], q[0] ** 2, q[0] * q[1], q[1] ** 2]
            small, moved = coefficients(name, len(q))
            turned = Rotation.from_rotvec(powers @ small) * turned
            shift = powers @ moved
        x = turned.apply(x - np.array(centre)) + np.array(centre) + shift
        rotation = turned.as_matrix() @ rotation
        child = parent
    return x, rotation


def random_angles(seed, share=0.75):
    """Angles within a share of the limits."""
    rng = np.random.default_rng(seed)
    limits = {n: np.radians(pair) for d in DESCRIPTION for n, pair in zip(d[3], d[6], strict=True)}
    return {n: float(share * rng.uniform(*pair)) for n, pair in limits.items()}
