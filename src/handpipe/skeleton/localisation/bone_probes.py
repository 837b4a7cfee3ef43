"""Points on a bone's marrow surface, and a little inside and outside of it, with which an image is probed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.bones.bodies import bodies

POINTS = 320  # on a bone
DEPTHS = (1.6, 1.1, 0.7, 0.4)  # mm inside the marrow, as deep as it is wide enough
OUTSIDE = 0.7  # mm outside the marrow: in the cortical shell
OPPOSITE = 0.9  # of a depth, which the opposite wall leaves at least


@dataclass(frozen=True)
class Probes:
    """Places of a bone in the neutral frame where an image is sampled.

    Attributes
    ----------
    points : (n, 3)
        Points on the marrow's surface.
    normals : (n, 3)
        Unit normals at these points.
    inner, outer : (n, 3)
        Points inside the marrow, and in the shell outside it, one of each a point.
    """

    points: Array
    normals: Array
    inner: Array
    outer: Array

    @staticmethod
    def sample(marrow: Surface, count: int = POINTS) -> Probes:
        """Random points, spread evenly; any first few of them are spread evenly, too."""
        normals = marrow.vertex_normals()
        corners = np.repeat(marrow.triangle_areas() / 3, 3)
        areas = np.bincount(marrow.triangles.ravel(), corners, len(normals))
        count = min(count, int((areas > 0).sum()))
        random = np.random.default_rng(0)
        chosen = random.choice(len(areas), count, replace=False, p=areas / areas.sum())
        points, outwards = marrow.vertices[chosen], normals[chosen]
        return Probes(points, outwards, _inside(marrow, points, outwards), points + OUTSIDE * outwards)

    @staticmethod
    def joined(parts: Sequence[Probes]) -> Probes:
        """Probes of several bones as one, mixed at random so that any first few lie on all of them."""
        order = np.random.default_rng(0).permutation(sum(len(p.points) for p in parts))
        fields = ("points", "normals", "inner", "outer")
        return Probes(*(np.concatenate([getattr(p, f) for p in parts])[order] for f in fields))

    def first(self, count: int) -> Probes:
        """The first few of the probes."""
        return Probes(self.points[:count], self.normals[:count], self.inner[:count], self.outer[:count])


def _inside(marrow: Surface, points: Array, normals: Array) -> Array:
    """Points as deep under the surface as `DEPTHS` allow where the opposite wall is no nearer."""
    inside, distance = points - DEPTHS[-1] * normals, Distance(marrow)
    for depth in reversed(DEPTHS[:-1]):
        deeper = points - depth * normals
        fits = distance.signed(deeper)[0] < -OPPOSITE * depth
        inside[fits] = deeper[fits]
    return inside


@dataclass(frozen=True)
class MovingBones:
    """Bones that move as one, and their probes together.

    Parameters
    ----------
    bones : tuple of str
        Names of the bones.
    probes : Probes
        Probes of all of them.
    middle : array (3,)
        Mean of the probes' points in neutral, mm.
    size : float
        Greatest distance of these points from their mean, mm.
    """

    bones: tuple[str, ...]
    probes: Probes
    middle: Array
    size: float


def all_bodies(dataset: Dataset, probes: Mapping[str, Probes]) -> list[MovingBones]:
    """Every bone in one body, the root's body first, then in the dataset's order."""
    grouped = bodies(dataset)
    alone = [(b,) for b in dataset.bones if not any(b in group for group in grouped)]
    groups = sorted([*grouped, *alone], key=lambda group: dataset.root_bone not in group)
    found = []
    for group in groups:
        joint = Probes.joined([probes[b] for b in group])
        middle = joint.points.mean(axis=0)
        size = float(np.linalg.norm(joint.points - middle, axis=1).max())
        found.append(MovingBones(tuple(group), joint, middle, size))
    return found
