"""Where a shape will be when its boundary has moved: a start for Newton's method."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray
from handpipe.fem.linear.factorisation import NotPositiveDefinite, SingularMatrix
from handpipe.fem.minimisation.spacing import spacing
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.potential import Sum

TOLERANCE = 1e-3  # relative error of the linear solve; looser ones leave compressed tets at nu = 0.48
NEAR = 1e-3  # of the spacing of vertices: a tangent from there serves


def predict(energy: Sum, x: Array, target: Array, free: BoolArray, workspace: Workspace) -> Array:
    """Move the fixed degrees of freedom of x (n, 3) to the target and the others with them.

    One linear solve with the tangent stiffness at x, projected where it is not positive definite.
    """
    start = x.copy()
    flat, aim = start.reshape(-1), target.reshape(-1)
    moved = np.where(free, 0.0, aim - flat)
    flat[~free] = aim[~free]
    if not moved.any():
        return start
    tangent = workspace.tangent(None, x, NEAR * spacing(x))
    change = _response(energy.hessian(x) if tangent is None else tangent, moved, free, workspace)
    if change is None:
        change = _response(energy.hessian(x, True), moved, free, workspace)
    if change is not None:  # else the old shape is a start too
        flat[free] += change
    return start


def _response(matrix: sp.csr_matrix, moved: Array, free: BoolArray, workspace: Workspace) -> Array | None:
    """Displacements of the unknowns that balance those of the others (3n,); None where there are none."""
    force = -(matrix @ moved)[free]
    block = workspace.block(matrix, free)
    try:
        return workspace.systems.solve(block, force, tolerance=TOLERANCE, free=free)
    except (NotPositiveDefinite, SingularMatrix):
        return None
