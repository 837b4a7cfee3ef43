"""Initial guesses of a registration: rotations that align principal axes, and translations of middles.

A phalanx is nearly a solid of revolution, and only its condyles tell the rotation about its long axis. A
carpal, or a stump of a phalanx, has no long axis at all: there rotations of all directions are tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Surface, sample_points

ROLLS = 8  # starts about the long axis
LONG = 1.6  # standard deviation along a long axis by that across it
ALIKE = 1.12  # ratio of areas up to which two surfaces are of the whole bone
SAMPLES = 2000  # points of a surface that tell its axes


@dataclass(frozen=True)
class _Principal:
    """Points (n, 3) on a surface, their right-handed principal axes (3, 3) in columns, the long one first."""

    points: Array
    axes: Array
    is_long: bool

    @staticmethod
    def measure(surface: Surface) -> _Principal:
        points = sample_points(surface, SAMPLES)
        values, vectors = np.linalg.eigh(np.cov(points.T))
        axes = vectors[:, ::-1]
        axes = axes * [1, 1, np.sign(np.linalg.det(axes))]
        return _Principal(points, axes, bool(values[2] > LONG**2 * values[1]))

    def anchors(self, in_parts: bool) -> list[Array]:
        """The middle, and the middles of two parts where another surface may hold one of them only."""
        middle = self.points.mean(axis=0)
        if not in_parts:
            return [middle]
        parts, _ = kmeans2(self.points, 2, minit="++", seed=0)
        return [middle, *parts]


def principal_starts(neutral: Surface, target: Surface) -> list[RigidTransform]:
    """Starts from neutral to the target; middle on middle, or on parts of the larger of the two.

    Long axis on long axis, either way round, rolled about it; all directions where one has no long axis.
    """
    a, b = _Principal.measure(neutral), _Principal.measure(target)
    turns = _rolls() if a.is_long and b.is_long else _all_directions()
    return _placed(a, b, turns, target.area() / neutral.area())


def uniform_starts(neutral: Surface, target: Surface) -> list[RigidTransform]:
    """Starts of all directions, whatever the shapes."""
    a, b = _Principal.measure(neutral), _Principal.measure(target)
    return _placed(a, b, _all_directions(), target.area() / neutral.area())


def _rolls() -> Array:
    rolls = Rotation.from_rotvec(np.linspace(0, 2 * np.pi, ROLLS, endpoint=False)[:, None] * [1.0, 0, 0])
    turned = rolls.as_matrix()
    return np.concatenate([turned, turned @ np.diag([-1.0, -1.0, 1.0])])


def _all_directions() -> Array:
    """Rotations (60, 3, 3) of an icosahedron: none is farther than 45 degrees from one of them."""
    return Rotation.create_group("I").as_matrix()


def _placed(a: _Principal, b: _Principal, turns: Array, areas: float) -> list[RigidTransform]:
    starts = []
    for turn in turns:
        rotation = b.axes @ turn @ a.axes.T
        for source in a.anchors(areas < 1 / ALIKE):
            starts += [RigidTransform(rotation, t - rotation @ source) for t in b.anchors(areas > ALIKE)]
    return starts
