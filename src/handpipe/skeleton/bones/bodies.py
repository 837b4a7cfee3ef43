"""Bones that move as one: their registered motions become one motion, that of all their points together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface

Bones = Mapping[str, RigidTransform]
APART = 0.3  # mm, root mean square: ten times what bones that did move as one are apart in a generated hand


def bodies(dataset: Dataset) -> list[tuple[str, ...]]:
    """Groups of two or more bones that joints without degrees of freedom connect, in file order."""
    body = {bone: bone for bone in dataset.bones}
    for joint in dataset.joints.values():
        if not joint.angles:
            old, new = body[joint.child], body[joint.parent]
            body = {bone: new if b == old else b for bone, b in body.items()}
    groups = (tuple(b for b in body if body[b] == lead) for lead in dict.fromkeys(body.values()))
    return [group for group in groups if len(group) > 1]


def moved_as_one(
    dataset: Dataset, transforms: Mapping[str, Bones], surfaces: Mapping[str, Surface]
) -> dict[str, dict[str, RigidTransform]]:
    """Transforms (pose -> bone -> transform) in which the bones of a body share one.

    It is the best rigid motion of all vertices of the bones that the pose has; small bones, whose own
    registration is weak, gain from large ones, and a bone that the pose lacks has the body's motion.
    """
    merged: dict[str, dict[str, RigidTransform]] = {pose: dict(bones) for pose, bones in transforms.items()}
    for body in bodies(dataset):
        for bones in merged.values():
            there = [b for b in body if b in bones]
            if there:
                rest = np.concatenate([surfaces[b].vertices for b in there])
                moved = np.concatenate([bones[b](surfaces[b].vertices) for b in there])
                bones.update(dict.fromkeys(body, RigidTransform.fit(rest, moved)))
    return merged


def moved_apart(
    dataset: Dataset, transforms: Mapping[str, Bones], surfaces: Mapping[str, Surface]
) -> dict[tuple[str, str], float]:
    """Bones that did not move as the body that the dataset's joints make them a part of.

    Parameters
    ----------
    dataset : Dataset
        Dataset with the joints.
    transforms : mapping of str to mapping of str to RigidTransform
        Registered transforms from neutral by pose and bone.
    surfaces : mapping of str to Surface
        Neutral surfaces in mm by bone.

    Returns
    -------
    dict of (str, str) to float
        Root mean square distance in mm, above `APART`, between where a bone is registered and where its body
        takes it, by pose and bone.
    """
    merged, found = moved_as_one(dataset, transforms, surfaces), {}
    jointed = [bone for body in bodies(dataset) for bone in body]
    for pose, bones in transforms.items():
        for bone in (bone for bone in jointed if bone in bones):
            points = surfaces[bone].vertices
            off = np.linalg.norm(bones[bone](points) - merged[pose][bone](points), axis=1)
            found[pose, bone] = float(np.sqrt(np.mean(off**2)))
    return {where: distance for where, distance in found.items() if distance > APART}
