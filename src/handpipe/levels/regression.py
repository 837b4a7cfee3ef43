"""Kernel regression of shapes on joint angles; kernel, ridge and angles are chosen by left-out frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.distance import cdist

from handpipe.core import Array, IntArray

# Degree of a polynomial, or zero and the width of a Gaussian beside a linear function.
KERNELS = ((1, 0.0), (2, 0.0), (3, 0.0), (0, 0.5), (0, 1.0), (0, 2.0))
RIDGES = (1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)  # of the kernel's mean diagonal
FOLDS = 4  # of the learned frames, of which each in turn is left out
BETTER = 0.98  # of the squared error of a choice before: a later, richer one has to be below
TRUNCATION = 0.05  # of the left-out squared error, that shapes which are left out may add
MOST_SHAPES = 24  # of a part


@dataclass(frozen=True)
class Choice:
    """What a part's regression is of: its angles' numbers, kernel and ridge."""

    angles: tuple[int, ...]
    kernel: tuple[int, float]
    ridge: float


@dataclass(frozen=True, eq=False)
class Regression:
    """A part's shapes and what joint angles make of them.

    shapes (K, m) of m numbers; gains (F, K) on the kernel between a pose and the F learned ones; error: root
    mean square of the left-out numbers.
    """

    choice: Choice
    shapes: Array
    gains: Array
    error: float


def kernel_of(kernel: tuple[int, float], a: Array, b: Array) -> Array:
    """Kernel (p, q) between scaled angles (p, d) and (q, d); the compiled one is `kernels.coefficients`."""
    degree, width = kernel
    linear = 1.0 + a @ b.T / max(a.shape[1], 1)
    if degree:
        return np.asarray(linear**degree)
    return np.asarray(linear + np.exp(-cdist(a, b, "sqeuclidean") / (2 * width**2)))


def fit_regression(places: Array, values: Array, neighbourhoods: Sequence[tuple[int, ...]]) -> Regression:
    """The regression that predicts left-out frames best.

    places (F, a): scaled angles; values (F, m); neighbourhoods: numbers of angles, the fewest first.
    """
    gram = values @ values.T
    folds = np.arange(len(places)) % FOLDS
    best, least = Choice((), KERNELS[0], RIDGES[-1]), np.inf
    for angles, kernel in product(dict.fromkeys(neighbourhoods), KERNELS):
        table = kernel_of(kernel, places[:, angles], places[:, angles])
        for ridge, error in zip(RIDGES, _left_out(table, gram, folds), strict=True):
            if error < BETTER * least:
                best, least = Choice(angles, kernel, ridge), error
    table = kernel_of(best.kernel, places[:, best.angles], places[:, best.angles])
    solved = np.linalg.solve(table + best.ridge * _size(table) * np.eye(len(table)), np.eye(len(table)))
    left, scales, shapes = _components(values, least)
    return Regression(best, shapes, solved @ (left * scales), float(np.sqrt(least / max(values.size, 1))))


def _components(values: Array, error: float) -> tuple[Array, Array, Array]:
    """Principal components of values (F, m): as many as matter beside an error."""
    left, scales, right = np.linalg.svd(values, full_matrices=False)
    remaining = np.append(np.cumsum((scales**2)[::-1])[::-1], 0.0)  # without the first k
    count = int(np.argmax(remaining <= max(TRUNCATION * error, np.finfo(float).tiny)))
    count = min(count, MOST_SHAPES)
    return left[:, :count], scales[:count], right[:count]


def _size(table: Array) -> float:
    return float(np.trace(table)) / len(table)


def _left_out(table: Array, gram: Array, folds: IntArray) -> Array:
    """Squared errors of left-out frames by ridge, from the kernel (F, F) and values' products (F, F)."""
    errors = np.zeros(len(RIDGES))
    for fold in np.unique(folds):
        out, kept = np.flatnonzero(folds == fold), np.flatnonzero(folds != fold)
        if len(kept) == 0:
            return np.full(len(RIDGES), np.inf)
        values, vectors = np.linalg.eigh(table[np.ix_(kept, kept)])
        across = table[np.ix_(out, kept)] @ vectors
        for i, ridge in enumerate(RIDGES):
            predict = (across / (np.maximum(values, 0.0) + ridge * _size(table))) @ vectors.T
            errors[i] += (
                np.trace(gram[np.ix_(out, out)])
                - 2 * np.sum(predict * gram[np.ix_(out, kept)])
                + np.sum((predict @ gram[np.ix_(kept, kept)]) * predict)
            )
    return np.maximum(errors, 0.0)
