"""Preconditioned conjugate gradients that stop early where they converge too slowly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
import scipy.sparse as sp
from numba import njit

from handpipe.core import Array

JUDGED_AFTER = 4  # iterations at least (or a quarter of all), whose mean rate foretells the rest
SLACK = 1.5  # since convergence speeds up
SLOWEST = -1e-3  # logarithm of the rate of an iteration that is counted with


class End(Enum):
    """Why the iterations stopped."""

    CONVERGED = "converged"
    NEGATIVE_CURVATURE = "a direction of negative curvature"
    INDEFINITE_PRECONDITIONER = "the preconditioner is not positive definite"
    TOO_SLOW = "too slow"


@dataclass(frozen=True)
class Iterations:
    """An approximate solution x (N,), how many iterations, |b - A x| / |b|, and why they ended."""

    x: Array
    count: int
    residual: float
    end: End


def conjugate_gradients(
    matrix: sp.csr_matrix,
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    most: int,
    foretell: bool = True,
) -> Iterations:
    """Solve A x = b from x = 0 in at most `most` iterations.

    Converged where both norms have fallen by `tolerance`: that of the preconditioner, r^T M^-1 r, which
    is the energy of the error where M is near A, and the Euclidean one of the true residual b - A x, which
    inexact Newton methods bound. With `foretell`, ends as too slow as soon as the rate so far foretells far
    more than `most`.
    """
    size = norm(b)
    x, r = np.zeros_like(b), b.copy()
    if size == 0.0:
        return Iterations(x, 0, 0.0, End.CONVERGED)
    z = precondition(r)
    p, rz = z, dot(r, z)
    first, count, end = rz, 0, End.TOO_SLOW
    if rz <= 0.0:
        return Iterations(x, 0, 1.0, End.INDEFINITE_PRECONDITIONER)
    while count < most:
        ap = matrix @ p
        curvature = dot(p, ap)
        count += 1
        if curvature <= 0.0:
            end = End.NEGATIVE_CURVATURE
            break
        x += (rz / curvature) * p
        r -= (rz / curvature) * ap
        z = precondition(r)
        new = dot(r, z)
        if not new > 0.0 and np.any(r):
            end = End.INDEFINITE_PRECONDITIONER
            break
        left = max(math.sqrt(new / first), norm(r) / size)
        if left <= tolerance:
            r = b - matrix @ x  # the recurrence drifts
            if norm(r) <= tolerance * size:
                end = End.CONVERGED
                break
            z = precondition(r)
            p, rz = z, dot(r, z)
            continue
        if foretell and count >= max(JUDGED_AFTER, most // 4):
            # The Euclidean norm may rise at first; the preconditioner's norm shows the rate.
            foretold = count * math.log(tolerance) / min(0.5 * math.log(new / first), SLOWEST)
            if foretold > SLACK * most:
                break
        p = z + (new / rz) * p
        rz = new
    return Iterations(x, count, norm(b - matrix @ x) / size, end)


@njit(cache=True)
def dot(a: Array, b: Array) -> float:
    """Inner product, by one thread: a threaded BLAS waits for cores that the factor's threads use."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def norm(a: Array) -> float:
    """Euclidean norm, likewise."""
    return math.sqrt(dot(a, a))
