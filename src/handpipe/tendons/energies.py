"""Energies of a rod's positions: hooks, pull and bending (Zheng et al. 2022, Eq. 10-12).

Each has `value(x)`, `gradient(x) -> (n, 3)` and `add_hessian(x, blocks, exact)` for x (n, 3). Hessians are block
banded: blocks[i, k] (3, 3) is the second derivative by x_i and x_i+k, k = 0..REACH. `refresh(x)` renews what one
iteration of the solver holds fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from handpipe.tendons.rod import Array, IntArray, closest_on_rod, point_at

REACH = 3  # vertices i and i + REACH may share a term, no further


class RodEnergy(Protocol):
    def refresh(self, x: Array) -> None: ...
    def value(self, x: Array) -> float: ...
    def gradient(self, x: Array) -> Array: ...
    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None: ...


def empty_blocks(n: int) -> Array:
    """A zero Hessian (n, REACH + 1, 3, 3)."""
    return np.zeros((n, REACH + 1, 3, 3))


@dataclass
class Pull:
    """-x_end . force: a constant force (3,) at the free end, Eq. 11 with c1 in the force."""

    force: Array

    def refresh(self, x: Array) -> None:
        pass

    def value(self, x: Array) -> float:
        return -float(x[-1] @ self.force)

    def gradient(self, x: Array) -> Array:
        g = np.zeros_like(x)
        g[-1] = -self.force
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        pass


@dataclass
class Bend:
    """stiffness / length * sum(1 - d_i . d_i+1) over neighbouring segment directions d.

    The bending part of Eq. 12 in the positions: between hooks Eq. 4 alone is a chain of straight spans with a
    kink at each hook; this rounds the kinks over a length sqrt(stiffness / tension). Written as the quadratic
    form |x_i-1 - 2 x_i + x_i+1|^2 / 2, which is the same where the segments keep their length.
    """

    stiffness: float
    length: float

    def refresh(self, x: Array) -> None:
        pass

    def _second(self, x: Array) -> Array:
        return x[:-2] - 2.0 * x[1:-1] + x[2:]

    @property
    def _scale(self) -> float:
        return self.stiffness / self.length**3

    def value(self, x: Array) -> float:
        return 0.5 * self._scale * float(np.sum(self._second(x) ** 2))

    def gradient(self, x: Array) -> Array:
        second = self._scale * self._second(x)
        g = np.zeros_like(x)
        g[:-2] += second
        g[1:-1] -= 2.0 * second
        g[2:] += second
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        n = len(x)
        identity = self._scale * np.eye(3)
        stencil = (1.0, -2.0, 1.0)
        for a in range(3):
            for b in range(a, 3):
                blocks[a : n - 2 + a, b - a] += stencil[a] * stencil[b] * identity


@dataclass
class Hooks:
    """weight * squared distance of each hook (k, 3) to the closest point of the rod, Eq. 10.

    The closest point is minimised over at every evaluation, so that the rod slides freely. Hooks that lie
    past an end of the rod let go of it: pulling the end towards them would stretch a taut rod.
    """

    points: Array
    weights: Array | float = 1.0
    held: Array = field(init=False)

    def __post_init__(self) -> None:
        self.points = np.asarray(self.points, float).reshape(-1, 3)
        self.weights = np.broadcast_to(np.asarray(self.weights, float), len(self.points))
        self.held = np.ones(len(self.points), bool)

    def refresh(self, x: Array) -> None:
        segment, t, _ = closest_on_rod(self.points, x)
        self.held = ~(((segment == 0) & (t == 0.0)) | ((segment == len(x) - 2) & (t == 1.0)))

    def _at(self, x: Array) -> tuple[IntArray, Array, Array, Array]:
        segment, t, _ = closest_on_rod(self.points[self.held], x)
        residual = point_at(x, segment, t) - self.points[self.held]
        return segment, t, residual, self.weights[self.held]

    def value(self, x: Array) -> float:
        _, _, r, w = self._at(x)
        return float(w @ np.sum(r * r, axis=1))

    def gradient(self, x: Array) -> Array:
        segment, t, r, w = self._at(x)
        g = np.zeros_like(x)
        np.add.at(g, segment, (2.0 * w * (1.0 - t))[:, None] * r)
        np.add.at(g, segment + 1, (2.0 * w * t)[:, None] * r)
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        """Exact: the Schur complement by t of the Hessian in (x, t). Otherwise its Gauss-Newton part."""
        segment, t, r, w = self._at(x)
        e = x[segment + 1] - x[segment]
        slides = (t > 0.0) & (t < 1.0)
        shape = (1.0 - t, t)
        cross = []
        for a, sign in ((0, -1.0), (1, 1.0)):
            column = shape[a][:, None] * e + (sign * r if exact else 0.0)
            cross.append(np.where(slides[:, None], column, 0.0) / np.linalg.norm(e, axis=1)[:, None])
        for a in range(2):
            for b in range(a, 2):
                block = (shape[a] * shape[b])[:, None, None] * np.eye(3)
                block = block - cross[a][:, :, None] * cross[b][:, None, :]
                np.add.at(blocks, (segment + a, b - a), 2.0 * w[:, None, None] * block)
