"""A model's joints carried over to another person's bones, by the similarity of each bone."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
import trimesh

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface as Mesh

Surface = tuple[Array, IntArray]
Similarity = tuple[Array, Array]
"""Matrix (3, 3), a rotation times a scale, and offset (3,) in mm."""
log = logging.getLogger(__name__)


class CarriedHinge(Protocol):
    """A centre (3,) in mm and an axis (3,) of about unit length."""

    @property
    def centre(self) -> Array:
        """A point (3,) of the axis in mm."""
        ...

    @property
    def axis(self) -> Array:
        """Direction (3,) of the axis, of about unit length."""
        ...


def similarity(
    model: Mesh, bone: Surface, ours: Array, theirs: Array, *, points: int | None = None
) -> Similarity:
    """Matrix and offset that carry the model's bone onto ours.

    ours, theirs: rotations (3, 3) whose columns are the same rough directions of both, the long axis first;
    points: how many to take in place of our whole surface, which is far faster.
    """
    source = model.vertices
    scale = np.ptp(bone[0] @ ours[:, 0]) / np.ptp(source @ theirs[:, 0])
    start = np.eye(4)
    start[:3, :3] = scale * ours @ theirs.T
    start[:3, 3] = bone[0].mean(axis=0) - start[:3, :3] @ source.mean(axis=0)
    sample = trimesh.Trimesh(source, model.triangles, process=False).sample(1500, seed=0)
    target = trimesh.Trimesh(*bone, process=False)
    fitted, _, _ = trimesh.registration.icp(
        sample,
        target if points is None else target.sample(points, seed=1),
        initial=start,
        scale=True,
        reflection=False,
        max_iterations=60,
    )
    return fitted[:3, :3], fitted[:3, 3]


def carried(
    name: str, hinges: Sequence[CarriedHinge], bones: Sequence[str], carry: Mapping[str, Similarity]
) -> tuple[Array, Array]:
    """Unit axes (k, 3) and the centre (3,) of a joint, averaged over how each of its bones carries them."""
    centres, axes = [], []
    for bone in bones:
        matrix, offset = carry[bone]
        scale = np.cbrt(np.linalg.det(matrix))
        centres.append(matrix @ hinges[0].centre + offset)
        axes.append([matrix @ hinge.axis / scale for hinge in hinges])
    apart = np.linalg.norm(centres[0] - centres[-1])
    log.info("%s: the model's centres by parent and by child lie %.1f mm apart", name, apart)
    axis = np.mean(axes, axis=0)
    return axis / np.linalg.norm(axis, axis=1, keepdims=True), np.mean(centres, axis=0)
