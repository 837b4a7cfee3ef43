"""The string of Wang 2021 §5.9.5 as problems on a line: what slopes its objectives can give at all.

The derivations are in docs/shapes-string.md. Slopes are constant in each of n equal cells, so that the mean
slopes of the intervals between marks are exact sums. All objectives are sums of squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from handpipe.core import Array

KNOTS, TARGETS = np.array([0.0, 0.25, 0.5, 1.0]), np.array([0.0, 0.25, 1.5, 2.0])
SLOPES = np.diff(TARGETS) / np.diff(KNOTS)
MET = 1e7  # weight of marks that are met (positions to about 1e-5)
PRECISE = 1e-13  # relative change of the unknowns and of the objective at which a search ends
MOST = 400  # evaluations


@dataclass(frozen=True)
class Slopes:
    """Slopes (n,) in equal cells of the string.

    elastic: Lagrange multiplier c of Wang 2021 Eq. 5.27, zero where nothing is stretched elastically.
    """

    local: Array
    elastic: float = 0.0

    @property
    def positions(self) -> Array:
        """(n + 1,) from 0."""
        return np.concatenate([[0.0], np.cumsum(self.local)]) / len(self.local)

    @property
    def missed(self) -> float:
        """Largest distance of a mark from its place."""
        at = np.round(KNOTS * len(self.local)).astype(int)
        return float(np.abs(self.positions[at] - TARGETS).max())

    @property
    def overshoot(self) -> float:
        """How far slopes leave the interval from 1 to 5, in units of its width."""
        return overshoot(self.local)


def overshoot(local: Array) -> float:
    """How far local slopes leave the interval from 1 to 5, in units of its width."""
    return float(max(SLOPES.min() - local.min(), local.max() - SLOPES.max(), 0.0) / np.ptp(SLOPES))


def plastic_1d(cells: int, stiffness: float, weight: float = MET) -> Slopes:
    """Wang 2021 Eq. 5.26 and 5.27: plastic slopes f smooth, x the elastic equilibrium.

    The equilibrium has x' = f - c f^2 with c = (integral of f - 2) / (integral of f^2).
    stiffness: beta. weight: alpha of the two landmarks.
    """
    h = 1.0 / cells

    def slopes(f: Array) -> tuple[Array, float]:
        c = (f.sum() * h - TARGETS[-1]) / (f @ f * h)
        return f - c * f * f, float(c)

    def residuals(f: Array) -> Array:
        local, c = slopes(f)
        return np.concatenate(
            [np.diff(f) / np.sqrt(h), np.sqrt(weight) * _misses(local), np.sqrt(stiffness * h) * c * f]
        )

    return Slopes(*slopes(_least(residuals, np.full(cells, TARGETS[-1]))))


def logarithmic_1d(cells: int, order: int = 2) -> Slopes:
    """Our objective on a line: x' = exp(u), |L u|^2 least with the graph Laplacian L; marks are met.

    order: 1 for the root of L in place of L.
    """
    differences = np.diff(np.eye(cells), axis=0) * cells
    smooth = differences.T @ differences if order == 2 else differences

    def residuals(u: Array, weight: float) -> Array:
        local = np.exp(u)
        return np.concatenate(
            [
                smooth @ u / np.sqrt(cells),
                np.sqrt(weight) * np.append(_misses(local), local.mean() - TARGETS[-1]),
            ]
        )

    u = np.full(cells, np.log(TARGETS[-1]))
    for weight in (1e2, 1e4, 1e6, MET):
        u = _least(partial(residuals, weight=weight), u)
    return Slopes(np.exp(u))


def _misses(local: Array) -> Array:
    """Errors (2,) of the two inner marks."""
    n = len(local)
    ends = np.round(KNOTS[1:3] * n).astype(int)
    return np.array([local[:end].sum() / n for end in ends]) - TARGETS[1:3]


def _least(residuals: Callable[[Array], Array], start: Array) -> Array:
    found = least_squares(residuals, start, xtol=PRECISE, ftol=PRECISE, gtol=None, max_nfev=MOST)
    return np.asarray(found.x)
