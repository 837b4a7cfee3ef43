"""Joint angles from the bones' rotations in a BVH file, and back."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, InputError, RigidTransform
from handpipe.skeleton.drivers.bone_lines import bone_lines, bone_tips, joint_places
from handpipe.skeleton.drivers.bvh import POSITIONS, Bvh, BvhJoint, read_bvh
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.posing.inverse_kinematics import ReachOptions, solve
from handpipe.skeleton.posing.targets import LEVER, Orientation
from handpipe.skeleton.rig.rig import Rig

LOG = logging.getLogger(__name__)
SAME = 1e-2  # mm; a skeleton whose joints are as near to the rig's is in the rig's own frame
FLAT = 0.02  # a skeleton this thin, relative to its length, does not determine its turn about it
UNLIKE = 0.3  # distance of the joints from the rig's, relative to their spread
CHANNELS = ("Zrotation", "Xrotation", "Yrotation")
REST_WEIGHT = 1e-3  # of the angles at rest, where directions leave them open
UNMET = np.radians(10.0)  # rad by which a bone may miss its direction without a warning


def bvh_frame_names(
    path: str | Path, bones: Sequence[str] = (), names: Mapping[str, str] | None = None
) -> list[str]:
    """Names of a BVH file's frames, which have none of their own: frame1, frame2, ...

    Parameters
    ----------
    path : str or Path
        BVH file.
    bones : sequence of str, optional
        Bones of the rig, its root first. Without them the joints' names are not checked.
    names : mapping of str to str, optional
        Joint of the BVH file by bone, where their names differ.

    Returns
    -------
    list of str
        Names in the order of the file.

    Raises
    ------
    InputError
        If the file is wrong, or its joints have none of the bones' names.
    """
    bvh = read_bvh(path)
    if bones:
        _matching(path, bvh, bones, names or {})
    return _names(bvh)


def read_bvh_angles(path: str | Path, rig: Rig, names: Mapping[str, str] | None = None) -> dict[str, Angles]:
    """Joint angles of a BVH file's frames, within their limits.

    The file's axes and scale are found from its joints' places at rest. Where its bones point elsewhere at
    rest than the rig's, directions of bones are carried over and not rotations.

    Parameters
    ----------
    path : str or Path
        BVH file.
    rig : Rig
        Rig that the frames move.
    names : mapping of str to str, optional
        Joint of the BVH file that turns a bone, by bone, where their names differ. Bones that the file lacks
        stay at rest.

    Returns
    -------
    dict of str to dict of str to float
        Angles in rad by frame and angle name.

    Raises
    ------
    InputError
        If the file has none of the bones, or its skeleton does not have the rig's shape.
    """
    bvh = read_bvh(path)
    joints = _matching(path, bvh, [rig.root, *(b for b in rig.bones if b != rig.root)], names or {})
    turn = _alignment(path, bvh, rig, joints)
    rest = _rest_turns(bvh, rig, joints, turn)
    rotations = bvh.rotations()
    base = _root_rotations(bvh, rig, joints, rotations)
    wanted = {
        b: turn @ np.swapaxes(base, 1, 2) @ rotations[j] @ turn.T @ rest[b].T for b, j in joints.items()
    }
    frames: dict[str, Angles] = {}
    angles: Angles = {}
    for i, frame in enumerate(_names(bvh)):
        targets = [Orientation(b, r[i]) for b, r in wanted.items() if b != rig.root]
        found = solve(
            rig, targets, start=angles, options=ReachOptions(rest_weight=REST_WEIGHT, restarts=i == 0)
        )
        angles = frames[frame] = found.angles
        if max(found.distances) > LEVER * UNMET:
            LOG.warning("%s: %s: %s", path, frame, found)
    return frames


def bvh_of(rig: Rig, frames: Mapping[str, Mapping[str, float]], seconds: float = 0.04) -> Bvh:
    """The rig's bones at frames of angles in rad as a skeleton, one joint a bone, in mm.

    Small residual translations are left out: BVH joints keep their offsets.
    """
    places, tips = {rig.root: np.zeros(3)} | joint_places(rig), bone_tips(rig)
    parents: dict[str, str | None] = {rig.root: None} | dict(rig.parents)
    order = _depth_first(rig.root, rig.parents)
    joints = tuple(
        BvhJoint(
            bone,
            parents[bone],
            places[bone] - (0 if parents[bone] is None else places[str(parents[bone])]),
            CHANNELS if parents[bone] else (*POSITIONS, *CHANNELS),
            tips[bone] - places[bone] if bone in tips else None,
        )
        for bone in order
    )
    rows = []
    for angles in frames.values():
        bones, row = rig.bone_transforms(angles), [0.0, 0.0, 0.0]
        for bone in order:
            parent = parents[bone]
            local = (bones[parent].rotation.T if parent else np.eye(3)) @ bones[bone].rotation
            row += list(Rotation.from_matrix(local).as_euler("ZXY", degrees=True))
        rows.append(row)
    return Bvh(joints, np.array(rows), seconds)


def _depth_first(bone: str, parents: Mapping[str, str]) -> list[str]:
    """A BVH file lists all below a joint before the joint's next sibling."""
    below = [b for child, p in parents.items() if p == bone for b in _depth_first(child, parents)]
    return [bone, *below]


def _names(bvh: Bvh) -> list[str]:
    return [f"frame{i}" for i in range(1, len(bvh.values) + 1)]


def _matching(path: str | Path, bvh: Bvh, bones: Sequence[str], names: Mapping[str, str]) -> dict[str, str]:
    """The rig's bones, its root first, with the BVH joints that turn them."""
    there = {j.name for j in bvh.joints}
    for bone, joint in names.items():
        if bone not in bones:
            raise InputError(path, f"bones.{bone}", "is not a bone of the rig", f"Bones: {', '.join(bones)}")
        if joint not in there:
            raise InputError(
                path, joint, "is not a joint of this file", f"Joints: {', '.join(sorted(there))}"
            )
    joints = {b: names.get(b, b) for b in bones if names.get(b, b) in there}
    if not set(joints) - {bones[0]}:
        remedy = "Name the joints by `bones` in the scene file"
        raise InputError(path, "joints", f"none is named as a bone of the rig ({', '.join(bones)})", remedy)
    return joints


def _alignment(path: str | Path, bvh: Bvh, rig: Rig, joints: Mapping[str, str]) -> Array:
    """Rotation (3, 3) from the file's axes to the rig's, from the joints' places at rest."""
    places, ends = bvh.places, joint_places(rig)
    bones = [b for b in joints if b != rig.root]
    ours = np.array([ends[b] for b in bones])
    theirs = np.array([places[joints[b]] for b in bones])
    ours, theirs = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    if np.abs(ours - theirs).max() < SAME:
        return np.eye(3)
    spreads = [np.linalg.svd(p, compute_uv=False) for p in (ours, theirs)]
    if any(len(s) < 2 or s[1] < FLAT * s[0] for s in spreads):
        problem = "its joints lie on one line, so that its turn about it is not known"
        raise InputError(path, "offsets", problem, "Give more of the hand's joints")
    theirs = theirs * np.linalg.norm(ours) / np.linalg.norm(theirs)
    fit = RigidTransform.fit(theirs, ours)
    if np.linalg.norm(fit(theirs) - ours) > UNLIKE * np.linalg.norm(ours):
        problem = "its joints do not lie as the rig's do"
        raise InputError(path, "offsets", problem, "Check `bones` in the scene file, and left against right")
    return fit.rotation


def _rest_turns(bvh: Bvh, rig: Rig, joints: Mapping[str, str], turn: Array) -> dict[str, Array]:
    """For each bone the least rotation (3, 3) from its rest direction in the file to the rig's.

    A last bone takes its parent's: where End Sites lie is every author's own choice.
    """
    places, lines, parents = bvh.places, bone_lines(rig), rig.parents
    turns = {bone: np.eye(3) for bone in joints}
    for bone, name in joints.items():
        after = [places[j.name] for j in bvh.joints if j.parent == name]
        if bone in lines and len(after) == 1:
            theirs, ours = turn @ (after[0] - places[name]), lines[bone][1] - lines[bone][0]
            turns[bone] = least_rotation(theirs, ours)
        elif not after:
            turns[bone] = turns.get(parents.get(bone, bone), np.eye(3))
    return turns


def least_rotation(start: Array, end: Array) -> Array:
    """The rotation (3, 3) of least angle from the direction of one vector (3,) to that of another."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return np.eye(3)
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine)).as_matrix()


def _root_rotations(bvh: Bvh, rig: Rig, joints: Mapping[str, str], rotations: Mapping[str, Array]) -> Array:
    """Rotations (frames, 3, 3) in the file of what is the rig's root bone, which the rig holds at rest."""
    if rig.root in joints:
        return rotations[joints[rig.root]]
    first = next(b for b in joints if b != rig.root)
    carrier = next(j.parent for j in bvh.joints if j.name == joints[first])
    return np.broadcast_to(np.eye(3), (len(bvh.values), 3, 3)) if carrier is None else rotations[carrier]
