"""Where a shape will be when its boundary has moved: a start for Newton's method."""

from __future__ import annotations

import contextlib

import numpy as np
from numpy.typing import NDArray

from handpipe.fem.linear import NotPositiveDefinite, SingularMatrix
from handpipe.fem.potential import Sum
from handpipe.fem.reduction import FreeBlock
from handpipe.fem.system_sequence import SystemSequence

Array = NDArray[np.float64]

TOLERANCE = 1e-2  # relative error of the linear solve: the prediction itself is no better


def predict(energy: Sum, x: Array, target: Array, free: NDArray[np.bool_], systems: SystemSequence) -> Array:
    """Move the fixed degrees of freedom of x (n, 3) to the target and the others with them.

    One linear solve with the tangent stiffness at x, projected where it is not positive definite.
    """
    start = x.copy()
    flat, aim = start.reshape(-1), target.reshape(-1)
    moved = np.where(free, 0.0, aim - flat)
    flat[~free] = aim[~free]
    if not moved.any():
        return start
    for project in (False, True):
        matrix = energy.hessian(x, project)
        block = FreeBlock(matrix, free)
        force = -(matrix @ moved)[free]
        with contextlib.suppress(NotPositiveDefinite, SingularMatrix):
            flat[free] += systems.solve(block.matrix(matrix), force, tolerance=TOLERANCE, free=free)
            break
    return start  # where both fail, the old shape is a start too
