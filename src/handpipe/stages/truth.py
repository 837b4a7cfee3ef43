"""The truth of a generated subject, and transforms of bones against it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import RigidTransform, artifacts
from handpipe.mesh.surfaces import Surface


def true_pose(files: Sequence[Path], pose: str) -> dict[str, Any]:
    """All that is true in a pose, in its own frame (kind "truth").

    files: "{pose}.h5" of the poses whose truth is known. Raises `StopIteration` for another pose.
    """
    return artifacts.read(next(file for file in files if file.stem == pose), "truth")


def surfaces_in(group: Mapping[str, Any]) -> dict[str, Surface]:
    """Surfaces by name of a truth's group of organs."""
    return {name: Surface(d["vertices"], d["triangles"]) for name, d in group.items()}


def true_motion(known: Mapping[str, Any], bone: str) -> RigidTransform:
    """Transform of a bone from neutral into the frame of a pose whose truth `true_pose` gave."""
    group = known["bones"][bone]
    return RigidTransform(group["rotation"], group["translation"])


def bone_errors(
    files: Sequence[Path],
    pose: str,
    found: Mapping[str, RigidTransform],
    centroids: Mapping[str, np.ndarray],
) -> tuple[list[float], list[float]]:
    """Angles in deg and distances of centroids in mm between found and true transforms, a bone each."""
    truth = true_pose(files, pose)
    rotations, translations = [], []
    for bone, centroid in centroids.items():
        true = true_motion(truth, bone)
        rotations.append(float(np.degrees(found[bone].angle_to(true))))
        translations.append(float(np.linalg.norm(found[bone](centroid[None]) - true(centroid[None]))))
    return rotations, translations
