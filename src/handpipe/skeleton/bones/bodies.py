"""Bones that move as one: their registered motions become one motion, that of all their points together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface

Bones = Mapping[str, RigidTransform]


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
