"""The upper envelope of piecewise linear functions on a tet mesh, cut into tets with one label each.

Abdrashitov 2021 §4, with another algorithm. Functions are taken one after the
other. The envelope of those before is one number a vertex, linear in every tet; the next function is above or
below it by the signs of their differences at vertices, and wherever an edge joins two signs it is bisected at
its zero. Signs belong to vertices and zeros to edges, shared by all tets around, so that no decision can
differ from one tet to the next: the result conforms whatever the values, ties included.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numba import njit

from handpipe.anatomy.improvement.splitting import MarkedEdges, bisect
from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.mesh.tets import EDGES, TetMesh

log = logging.getLogger(__name__)

LEAST_SNAP = 1e-6  # closer to a vertex than this share of an edge, a zero is at the vertex
LEAST_VOLUME = 1e-14  # of a tet, as a share of the cube of its longest edge: far above rounding


@dataclass(frozen=True, eq=False)
class Envelope:
    """A mesh whose every tet has one function that is the largest all over it.

    `labels` (m,) columns of `values` (n, k), the functions at the vertices; `source` (m,) the tet of the
    given mesh in which each lies. The given vertices come first. At the corners of a tet the value of its
    label is the largest of all, exactly.
    """

    mesh: TetMesh
    labels: IntArray
    values: Array
    source: IntArray


def upper_envelope(mesh: TetMesh, values: Array, *, snap: float = 0.0) -> Envelope:
    """Cut a mesh so that each tet has one largest function; of equal functions the first one counts.

    A zero of a difference that is close to a vertex is moved to that vertex: the later function is set equal
    to the envelope there. This removes the smallest tets, and moves the border between labels by at most the
    share `snap` of an edge.

    Parameters
    ----------
    mesh : TetMesh
        Mesh to be cut.
    values : array (n, k)
        Functions at the vertices.
    snap : float
        Share of an edge, below 0.5, within which a zero moves to a vertex.

    Returns
    -------
    Envelope
        The cut mesh, its labels and the functions on it.

    Raises
    ------
    InputError
        For values or a share that do not fit.
    """
    _check(mesh, values, snap)
    state = _State(
        mesh.vertices,
        mesh.tets,
        np.zeros(len(mesh.tets), np.int64),
        np.arange(len(mesh.tets)),
        np.array(values, dtype=np.float64),
        np.array(values[:, 0], dtype=np.float64),
    )
    for column in range(1, values.shape[1]):
        state = _with_function(state, column, max(snap, LEAST_SNAP))
        log.debug("envelope of %d functions: %d tets", column + 1, len(state.tets))
    return Envelope(TetMesh(state.vertices, state.tets), state.labels, state.values, state.source)


def contenders(tets: IntArray, values: Array) -> Array:
    """Functions (n, k) with a common lower bound at vertices around which they are nowhere the largest.

    Their upper envelope is the same. All but one function are nearly zero at a curve: without this bound, the
    noise of the other functions would cut each of them there, although it is not the largest in the end.
    """
    corners = [values[tets, k] for k in range(values.shape[1])]
    surely = np.max([c.min(axis=1) for c in corners], axis=0)
    found = np.full_like(values, values.min() - 1.0)
    for k, at_corners in enumerate(corners):
        near = np.unique(tets[at_corners.max(axis=1) >= surely])
        found[near, k] = values[near, k]
    return found


def _check(mesh: TetMesh, values: Array, snap: float) -> None:
    if values.ndim != 2 or len(values) != len(mesh.vertices) or values.shape[1] == 0:
        problem = f"has the shape {values.shape} for {len(mesh.vertices)} vertices"
        raise InputError("upper_envelope", "values", problem, "Give a row a vertex, a column a function")
    if not np.isfinite(values).all():
        raise InputError("upper_envelope", "values", "NaN or infinite", "Solve for the functions again")
    if not 0 <= snap < 0.5:
        raise InputError("upper_envelope", "snap", f"is {snap}", "Choose it from 0 to below 0.5")


@dataclass(frozen=True, eq=False)
class _State:
    vertices: Array
    tets: IntArray
    labels: IntArray
    source: IntArray
    values: Array
    envelope: Array


def _with_function(state: _State, column: int, snap: float) -> _State:
    """The state after one more function."""
    difference = state.values[:, column] - state.envelope
    above = _tets_with_positive(state.tets, difference)
    if len(above) == 0:
        return state
    _snap_zeros(state.tets[above], difference, snap)
    while True:
        crossed, edges = _crossed(state.tets, above, difference)
        vertices, share = _zeros(state.vertices, difference, edges.ends)
        children, parents = bisect(
            state.tets[crossed], edges, edges.ranks(state.vertices), len(state.vertices)
        )
        flat = np.unique(parents[~_has_volume(vertices, children)])
        if len(flat) == 0:
            break
        _snap_nearest(state.tets[crossed[flat]], difference)
    tied = difference == 0
    state.values[tied, column] = state.envelope[tied]
    return _cut(
        state, column, difference, _Bisection(crossed, children, parents, edges.ends, vertices, share)
    )


@dataclass(frozen=True, eq=False)
class _Bisection:
    """The tets (c,) that the zero crosses, their children (k, 4) and of which of them (k,) each is a part.

    New vertices come last in `vertices` (n + e, 3), each at a `share` (e,) of the way between `ends` (e, 2).
    """

    crossed: IntArray
    children: IntArray
    parents: IntArray
    ends: IntArray
    vertices: Array
    share: Array


def _cut(state: _State, column: int, difference: Array, bisection: _Bisection) -> _State:
    """Replace the crossed tets by their children, and give the function the tets where it is above."""
    crossed, children, share = bisection.crossed, bisection.children, bisection.share
    a, b = bisection.ends.T
    between = (1 - share) * state.envelope[a] + share * state.envelope[b]
    new_values = (1 - share)[:, None] * state.values[a] + share[:, None] * state.values[b]
    new_values[:, column] = between
    values = np.concatenate([state.values, new_values])
    signs = np.concatenate([difference, np.zeros(len(share))])
    kept = np.ones(len(state.tets), dtype=bool)
    kept[crossed] = False
    parents = crossed[bisection.parents]
    tets = np.concatenate([state.tets[kept], children])
    labels = np.concatenate([state.labels[kept], state.labels[parents]])
    labels[_tets_with_positive(tets, signs)] = column
    return _State(
        bisection.vertices,
        tets,
        labels,
        np.concatenate([state.source[kept], state.source[parents]]),
        values,
        np.maximum(np.concatenate([state.envelope, between]), values[:, column]),
    )


@njit(cache=True)
def _tets_with_positive(tets, difference):  # type: ignore[no-untyped-def]
    out = np.empty(len(tets), np.int64)
    count = 0
    for t in range(len(tets)):
        for i in range(4):
            if difference[tets[t, i]] > 0:
                out[count] = t
                count += 1
                break
    return out[:count].copy()


def _crossed(tets: IntArray, above: IntArray, difference: Array) -> tuple[IntArray, MarkedEdges]:
    """The tets (c,) that the zero cuts, and the edges where it does."""
    sign = np.sign(difference)[tets[above]]
    marked = sign[:, EDGES[:, 0]] * sign[:, EDGES[:, 1]] < 0
    cut = marked.any(axis=1)
    return above[cut], MarkedEdges.number(tets[above[cut]], marked[cut], len(difference))


def _zeros(vertices: Array, difference: Array, ends: IntArray) -> tuple[Array, Array]:
    """All vertices with the zeros of the edges appended, and each zero's position along its edge.

    The position is the share (e,) of the way from the edge's first end.
    """
    a, b = ends.T
    share = difference[a] / (difference[a] - difference[b])
    zeros = (1 - share)[:, None] * vertices[a] + share[:, None] * vertices[b]
    return np.concatenate([vertices, zeros]), share


def _has_volume(vertices: Array, tets: IntArray) -> BoolArray:
    corners = vertices[tets]
    longest = ((corners[:, EDGES[:, 0]] - corners[:, EDGES[:, 1]]) ** 2).sum(axis=2).max(axis=1)
    return TetMesh(vertices, tets).volumes() > LEAST_VOLUME * longest**1.5


def _snap_zeros(tets: IntArray, difference: Array, snap: float) -> None:
    """Set to zero the differences (n,) at vertices that are close to a zero, nearest first.

    A vertex is close within the share `snap` of an edge.
    """
    ends = np.unique(np.sort(tets[:, EDGES].reshape(-1, 2), axis=1), axis=0)
    a, b = np.abs(difference[ends]).T
    crossing = (difference[ends[:, 0]] > 0) & (difference[ends[:, 1]] < 0)
    crossing |= (difference[ends[:, 0]] < 0) & (difference[ends[:, 1]] > 0)
    share = np.where(crossing, np.minimum(a, b) / np.maximum(a + b, 1e-300), 1.0)
    near = np.flatnonzero(share < snap)
    _nearer_to_zero(ends[near[np.argsort(share[near], kind="stable")]], difference)


@njit(cache=True)
def _nearer_to_zero(ends, difference):  # type: ignore[no-untyped-def]
    for i in range(len(ends)):
        a, b = ends[i]
        if difference[a] != 0 and difference[b] != 0:
            difference[a if abs(difference[a]) < abs(difference[b]) else b] = 0.0


def _snap_nearest(tets: IntArray, difference: Array) -> None:
    """Set to zero the difference (n,) of least size at a corner of each tet.

    This is the last resort against flat tets.
    """
    size = np.where(difference[tets] == 0, np.inf, np.abs(difference[tets]))
    difference[np.take_along_axis(tets, np.argmin(size, axis=1)[:, None], axis=1)] = 0.0
