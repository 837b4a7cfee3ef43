"""Biharmonic interpolation of a displacement of space with a linear part, and its derivatives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.distance import cdist

from handpipe.core import Array

CHUNK = 4_000_000  # distances computed at a time


class Biharmonic:
    """f(x) = sum_i w_i |x - s_i| + A x + b, of least bending energy through f(s_i) = t_i.

    f commutes with affine maps of the targets and with similarities of the sources. It is smooth except for a
    kink at each s_i, where `jacobian` leaves out the point's own term.

    Parameters
    ----------
    source : array (n, 3)
        Points s in mm.
    target : array (n, 3)
        Points t in mm to which f maps them.
    smoothing : float
        Weight in mm of the bending energy against the misfit at the points; with 0 f interpolates.

    Raises
    ------
    ValueError
        Where there are fewer than 4 points, all lie in a plane, or two are in one place without smoothing.

    References
    ----------
    Albrecht 2003 §5.2, after Bookstein.
    """

    def __init__(self, source: Array, target: Array, smoothing: float = 0.0) -> None:
        source, target = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
        self._middle = source.mean(axis=0)
        self._scale = float(np.abs(source - self._middle).max())
        self._centres = (source - self._middle) / self._scale if self._scale > 0 else source
        if len(source) < 4 or np.linalg.svd(self._centres, compute_uv=False)[2] < 1e-9 * len(source):
            raise ValueError("the points lie in a plane")
        solution = np.linalg.solve(
            system(self._centres, smoothing / max(self._scale, 1e-300)), _padded(target)
        )
        self._weights, self._offset, self._linear = solution[:-4], solution[-4], solution[-3:].T

    def __call__(self, points: Array) -> Array:
        """Where points (k, 3) go."""
        points = self._normalised(points)
        out = points @ self._linear.T + self._offset
        for part in _blocks(len(points), len(self._centres)):
            out[part] -= cdist(points[part], self._centres) @ self._weights
        return out

    def jacobian(self, points: Array) -> Array:
        """Derivatives (k, 3, 3) at points (k, 3): J[a, b] of coordinate a by coordinate b."""
        points = self._normalised(points)
        out = np.tile(self._linear, (len(points), 1, 1))
        moments = (self._weights[:, :, None] * self._centres[:, None, :]).reshape(-1, 9)
        for part in _blocks(len(points), len(self._centres)):
            length = cdist(points[part], self._centres)
            inverse = np.divide(1.0, length, out=np.zeros_like(length), where=length > 1e-12)
            # The sum of w_i (x - s_i)^T / |x - s_i|, as products of whole matrices.
            out[part] += (inverse @ moments).reshape(-1, 3, 3)
            out[part] -= (inverse @ self._weights)[:, :, None] * points[part, None, :]
        return out / self._scale

    def _normalised(self, points: Array) -> Array:
        return (np.asarray(points, dtype=float).reshape(-1, 3) - self._middle) / self._scale


def system(centres: Array, smoothing: float = 0.0) -> Array:
    """Matrix (n + 4, n + 4) of the interpolation: distances bordered by the linear part's conditions."""
    n = len(centres)
    matrix = np.zeros((n + 4, n + 4))
    matrix[:n, :n] = smoothing * np.eye(n) - cdist(centres, centres)
    border = np.column_stack([np.ones(n), centres])
    matrix[:n, n:], matrix[n:, :n] = border, border.T
    return matrix


def _padded(values: Array) -> Array:
    return np.vstack([values, np.zeros((4, values.shape[1]))])


def left_out(source: Array, target: Array) -> Array:
    """Leave-one-out residuals of a `Biharmonic` map without smoothing, from one inverse matrix.

    Parameters
    ----------
    source, target : array (n, 3)
        Points in mm, as `Biharmonic` takes them.

    Returns
    -------
    array (n, 3)
        Offset in mm of each target from the place to which the map through all other points takes its source.

    References
    ----------
    Rippa 1999.
    """
    middle = source.mean(axis=0)
    inverse = np.linalg.inv(system((source - middle) / np.abs(source - middle).max()))
    n = len(source)
    return (inverse[:n, :n] @ target) / np.diag(inverse)[:n, None]


def _blocks(points: int, centres: int) -> Iterator[slice]:
    step = max(CHUNK // centres, 1)
    return (slice(start, start + step) for start in range(0, points, step))
