"""Random walker segmentation with two classes on a voxel grid (Grady 2006).

The probability that a walk from a voxel reaches an inside seed first is harmonic: L p = 0 with the
seeds' values as boundary data, where L is the graph Laplacian with edge weights exp(-beta (g_i - g_j)^2)
(Grady 2006, Eqs. 1 and 10), over the edge's squared length where voxels are not cubes. The seven-point
operator is kept as arrays of edge weights on the grid, whose rim of one voxel has no edges and spares the
border's special cases. Conjugate gradients are preconditioned by multigrid with 2 x 2 x 2 aggregates: summing
the edges between aggregates is the Galerkin product, so that every level is again such a grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import Array, ConvergenceError

INSIDE, OUTSIDE = 1, 2  # values of seeds
MINIMUM_WEIGHT = 1e-6  # of an edge: with less, iterations stall in pockets behind strong edges
OVERCORRECTION = 0.55  # constant aggregates are nearly twice too stiff (Braess 1995)
COARSEST = 64  # voxels
SWEEPS_COARSEST = 12  # in each direction, on the coarsest level


class Stop(NamedTuple):
    """When a solution is near enough.

    Parameters
    ----------
    tolerance : float
        Largest error of the probability, as the preconditioned residual estimates it.
    max_iterations : int
        Most iterations.
    undecided : float
        The solution may stop short of the tolerance once the error's estimate leaves so few voxels in doubt
        of their side of 0.5, as a share of the voxels above 0.5. Pockets behind strong edges converge last,
        and far from any doubt.
    """

    tolerance: float = 1e-3
    max_iterations: int = 1000
    undecided: float = 0.0


class Level(NamedTuple):
    """Edges (3, nx, ny, nz) from each free voxel to its next along each axis, diagonal (nx, ny, nz)."""

    edges: Array
    diagonal: Array


def random_walker(
    values: NDArray,
    seeds: NDArray,
    beta: float,
    start: NDArray | None = None,
    spacing: NDArray | None = None,
    stop: Stop | None = None,
) -> Array:
    """Probability that a walk from a voxel reaches an inside seed first.

    The contrast of a sharp edge does not depend on the distance of the samples on either side. Therefore
    lengths weigh the edges and not the contrasts.

    Parameters
    ----------
    values : array (nx, ny, nz)
        Intensities in units of a tissue contrast, so that `beta` has no unit.
    seeds : array (nx, ny, nz)
        0 for free voxels, INSIDE or OUTSIDE.
    beta : float
        Weight of the contrast.
    start : array (nx, ny, nz), optional
        Initial guess.
    spacing : array (3,), optional
        Size of a voxel; by default voxels are cubes.
    stop : Stop, optional
        When a solution is near enough.

    Returns
    -------
    array (nx, ny, nz)
        Probability of each voxel.

    Raises
    ------
    ConvergenceError
        If the iterations do not suffice.
    """
    free = seeds == 0
    size = np.ones(3) if spacing is None else np.asarray(spacing, float)
    edges, ground, load = _system(
        np.pad(np.asarray(values, np.float64), 1),
        np.pad(np.asarray(seeds, np.uint8), 1),
        beta,
        (size.min() / size) ** 2,
        MINIMUM_WEIGHT,
    )
    guess = np.pad(np.zeros(seeds.shape) if start is None else np.where(free, start, 0.0), 1)
    solution = harmonic(edges, ground, load, guess, stop or Stop())
    return np.where(free, solution, seeds == INSIDE)


def harmonic(edges: Array, ground: Array, load: Array, start: Array, stop: Stop) -> Array:
    """Probability whose edges, pulls towards 1 and pulls towards 0 are in balance at every voxel.

    Parameters
    ----------
    edges : array (3, nx + 2, ny + 2, nz + 2)
        Weight from each voxel to its next along each axis; none to the rim or between seeds.
    ground : array (nx + 2, ny + 2, nz + 2)
        Weight of all that pulls a voxel: seeds beside it, and what is known of the voxel itself.
    load : array (nx + 2, ny + 2, nz + 2)
        Its part that pulls towards 1.
    start : array (nx + 2, ny + 2, nz + 2)
        Initial guess.
    stop : Stop
        When a solution is near enough.

    Returns
    -------
    array (nx, ny, nz)
        The probability, without the rim.

    Raises
    ------
    ConvergenceError
        If the iterations do not suffice.
    """
    solution = _conjugate_gradients(_hierarchy(edges, ground), load, start, stop)
    return np.clip(solution[1:-1, 1:-1, 1:-1], 0, 1)


@njit(cache=True)
def _system(values, seeds, beta, conductance, minimum):  # type: ignore[no-untyped-def]
    """Edges among free voxels, weights to seeds (ground) and weights to inside seeds (load)."""
    nx, ny, nz = values.shape
    edges = np.zeros((3, nx, ny, nz))
    ground, load = np.zeros(values.shape), np.zeros(values.shape)
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                for axis in range(3):
                    a, b, c = i + (axis == 0), j + (axis == 1), k + (axis == 2)
                    if a == nx - 1 or b == ny - 1 or c == nz - 1:
                        continue
                    here, there = seeds[i, j, k], seeds[a, b, c]
                    if here and there:
                        continue
                    w = conductance[axis] * np.exp(-beta * (values[i, j, k] - values[a, b, c]) ** 2)
                    w += minimum
                    if not here and not there:
                        edges[axis, i, j, k] = w
                    elif here:
                        ground[a, b, c] += w
                        load[a, b, c] += w * (here == 1)
                    else:
                        ground[i, j, k] += w
                        load[i, j, k] += w * (there == 1)
    return edges, ground, load


@njit(cache=True)
def _diagonal(edges, ground):  # type: ignore[no-untyped-def]
    """Row sums: all edges of a voxel and its ground."""
    out = ground.copy()
    nx, ny, nz = out.shape
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                out[i, j, k] += edges[0, i, j, k] + edges[0, i - 1, j, k]
                out[i, j, k] += edges[1, i, j, k] + edges[1, i, j - 1, k]
                out[i, j, k] += edges[2, i, j, k] + edges[2, i, j, k - 1]
    return out


@njit(cache=True)
def _coarsen(edges, ground, factor):  # type: ignore[no-untyped-def]
    """Sums over 2 x 2 x 2 aggregates: Galerkin product with piecewise constants, its edges times `factor`."""
    nx, ny, nz = ground.shape
    shape = ((nx + 1) // 2 + 1, (ny + 1) // 2 + 1, (nz + 1) // 2 + 1)
    coarse_edges, coarse_ground = np.zeros((3, *shape)), np.zeros(shape)
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                a, b, c = (i + 1) // 2, (j + 1) // 2, (k + 1) // 2
                coarse_ground[a, b, c] += ground[i, j, k]
                if i % 2 == 0:
                    coarse_edges[0, a, b, c] += factor * edges[0, i, j, k]
                if j % 2 == 0:
                    coarse_edges[1, a, b, c] += factor * edges[1, i, j, k]
                if k % 2 == 0:
                    coarse_edges[2, a, b, c] += factor * edges[2, i, j, k]
    return coarse_edges, coarse_ground


def _hierarchy(edges: NDArray, ground: NDArray) -> list[Level]:
    levels = [Level(edges, _diagonal(edges, ground))]
    while ground.size > COARSEST and max(ground.shape) > 4:
        edges, ground = _coarsen(edges, ground, OVERCORRECTION)
        levels.append(Level(edges, _diagonal(edges, ground)))
    return levels


@njit(cache=True, fastmath=True)
def _neighbours(edges, x, i, j, k):  # type: ignore[no-untyped-def]
    """Sum over a voxel's edges of weight times the neighbour's value."""
    return (
        edges[0, i - 1, j, k] * x[i - 1, j, k]
        + edges[0, i, j, k] * x[i + 1, j, k]
        + edges[1, i, j - 1, k] * x[i, j - 1, k]
        + edges[1, i, j, k] * x[i, j + 1, k]
        + edges[2, i, j, k - 1] * x[i, j, k - 1]
        + edges[2, i, j, k] * x[i, j, k + 1]
    )


@njit(cache=True, fastmath=True)
def _apply(edges, diagonal, x):  # type: ignore[no-untyped-def]
    out = np.zeros_like(x)
    nx, ny, nz = x.shape
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                d = diagonal[i, j, k]
                out[i, j, k] = d * x[i, j, k] - _neighbours(edges, x, i, j, k) if d > 0 else 0.0
    return out


@njit(cache=True, fastmath=True)
def _sweep(edges, diagonal, x, b, forward):  # type: ignore[no-untyped-def]
    """One Gauss-Seidel sweep in place; a backward sweep is the adjoint of a forward one."""
    nx, ny, nz = x.shape
    for ii in range(1, nx - 1):
        i = ii if forward else nx - 1 - ii
        for jj in range(1, ny - 1):
            j = jj if forward else ny - 1 - jj
            for kk in range(1, nz - 1):
                k = kk if forward else nz - 1 - kk
                d = diagonal[i, j, k]
                if d > 0:
                    x[i, j, k] = (b[i, j, k] + _neighbours(edges, x, i, j, k)) / d


@njit(cache=True, fastmath=True)
def _restrict_residual(edges, diagonal, x, b, shape):  # type: ignore[no-untyped-def]
    """Sums of b - A x over aggregates."""
    out = np.zeros(shape)
    nx, ny, nz = x.shape
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                d = diagonal[i, j, k]
                if d > 0:
                    r = b[i, j, k] - d * x[i, j, k] + _neighbours(edges, x, i, j, k)
                    out[(i + 1) // 2, (j + 1) // 2, (k + 1) // 2] += r
    return out


@njit(cache=True)
def _prolong_add(x, coarse, diagonal):  # type: ignore[no-untyped-def]
    nx, ny, nz = x.shape
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                if diagonal[i, j, k] > 0:
                    x[i, j, k] += coarse[(i + 1) // 2, (j + 1) // 2, (k + 1) // 2]


def _v_cycle(levels: list[Level], b: NDArray, depth: int = 0) -> Array:
    """One symmetric V-cycle from zero for A x = b."""
    edges, diagonal = levels[depth]
    x = np.zeros_like(b)
    if depth == len(levels) - 1:
        for forward in [True] * SWEEPS_COARSEST + [False] * SWEEPS_COARSEST:
            _sweep(edges, diagonal, x, b, forward)
        return x
    _sweep(edges, diagonal, x, b, True)
    residual = _restrict_residual(edges, diagonal, x, b, levels[depth + 1].diagonal.shape)
    _prolong_add(x, _v_cycle(levels, residual, depth + 1), diagonal)
    _sweep(edges, diagonal, x, b, False)
    return x


def _doubts(x: NDArray, error: NDArray) -> int:
    """How many voxels an error of this size may carry across 0.5."""
    return int(np.count_nonzero(np.abs(error) > np.abs(x - 0.5)))


def _conjugate_gradients(levels: list[Level], b: NDArray, x: NDArray, stop: Stop) -> Array:
    """The solution of the walker's system by preconditioned conjugate gradients.

    They end where the preconditioned residual, an estimate of the error, is below the tolerance, or moves no
    more than a share of the voxels across 0.5.
    """
    fine = levels[0]
    r = b - _apply(*fine, x)
    z = _v_cycle(levels, r)
    p, rz = z.copy(), (r * z).sum()
    for _ in range(stop.max_iterations):
        if np.abs(z).max() < stop.tolerance or _doubts(x, z) < stop.undecided * np.count_nonzero(x > 0.5):
            return x
        ap = _apply(*fine, p)
        alpha = rz / (p * ap).sum()
        x += alpha * p
        r -= alpha * ap
        z = _v_cycle(levels, r)
        rz, previous = (r * z).sum(), rz
        p *= rz / previous
        p += z
    raise ConvergenceError("the random walker", f"{stop.max_iterations} iterations were not enough")
