"""Local changes of a closed triangle mesh: split, collapse and flip an edge.

Half-edge h = 3 f + k runs from corner k of triangle f to its next corner; `twin[h]` is the half-edge that
runs the other way, `out[v]` a half-edge that leaves vertex v. A removed triangle has the corner -1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from handpipe.core import IntArray

SPLIT = 4 / 3  # of the wanted length: splitting and collapsing then both come closer to it
COLLAPSE = 4 / 5  # of the wanted length
FLATNESS = 0.5  # least cosine between an old and a new triangle's normal


class HalfEdges(NamedTuple):
    """Corner and twin (3 k,) of each half-edge, and a half-edge `out` (n,) of each vertex."""

    corner: IntArray
    twin: IntArray
    out: IntArray


def build(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Twins (3 k,) of a closed surface's half-edges, and each half-edge's fan (3 k,).

    A fan is the ring of triangles around a vertex; a vertex where two sheets touch has two.
    """
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    order = np.lexsort((end, start))
    mirrored = np.lexsort((start, end))
    twin = np.empty(len(start), dtype=np.int64)
    twin[order] = mirrored
    return twin, _fans(twin)


@njit(cache=True)
def _fans(twin):  # type: ignore[no-untyped-def]
    fan = np.full(len(twin), -1, np.int64)
    count = 0
    for first in range(len(twin)):
        if fan[first] >= 0:
            continue
        h = first
        while fan[h] < 0:
            fan[h] = count
            h = twin[_previous(h)]
        count += 1
    return fan


@njit(cache=True, inline="always")
def _next(h):  # type: ignore[no-untyped-def]
    return h - 2 if h % 3 == 2 else h + 1


@njit(cache=True, inline="always")
def _previous(h):  # type: ignore[no-untyped-def]
    return h + 2 if h % 3 == 0 else h - 1


@njit(cache=True, inline="always")
def _link(twin, g, h):  # type: ignore[no-untyped-def]
    twin[g] = h
    twin[h] = g


@njit(cache=True, inline="always")
def _set(corner, f, a, b, c):  # type: ignore[no-untyped-def]
    corner[3 * f] = a
    corner[3 * f + 1] = b
    corner[3 * f + 2] = c


@njit(cache=True)
def _distance(x, a, b):  # type: ignore[no-untyped-def]
    return np.sqrt((x[a, 0] - x[b, 0]) ** 2 + (x[a, 1] - x[b, 1]) ** 2 + (x[a, 2] - x[b, 2]) ** 2)


@njit(cache=True)
def _normal(p, q, r):  # type: ignore[no-untyped-def]
    return np.cross(q - p, r - p)


@njit(cache=True)
def _adjacent(a, b, corner, twin, out):  # type: ignore[no-untyped-def]
    h = out[a]
    while True:
        if corner[_next(h)] == b:
            return True
        h = twin[_previous(h)]
        if h == out[a]:
            return False


@njit(cache=True)
def _valence(a, twin, out):  # type: ignore[no-untyped-def]
    count, h = 0, out[a]
    while True:
        count += 1
        h = twin[_previous(h)]
        if h == out[a]:
            return count


@njit(cache=True)
def split_long(x, edges, fixed, length, n_vertices, n_faces):  # type: ignore[no-untyped-def]
    """Halve edges longer than SPLIT times `length`, but not between fixed vertices; returns new counts."""
    corner, twin, out = edges
    faces_before = n_faces
    for h in range(3 * faces_before):
        if corner[h] < 0 or n_vertices == len(x) or n_faces + 2 > len(corner) // 3:
            continue
        t = twin[h]
        a, b, c, d = corner[h], corner[_next(h)], corner[_previous(h)], corner[_previous(t)]
        if c == d or (fixed[a] and fixed[b]) or _distance(x, a, b) <= SPLIT * length:
            continue
        ta, tb, sa, sb = twin[_previous(h)], twin[_next(h)], twin[_next(t)], twin[_previous(t)]
        f1, f2, f3, f4, m = h // 3, t // 3, n_faces, n_faces + 1, n_vertices
        x[m] = 0.5 * (x[a] + x[b])
        n_vertices, n_faces = n_vertices + 1, n_faces + 2
        _set(corner, f1, a, m, c)
        _set(corner, f2, m, a, d)
        _set(corner, f3, m, b, c)
        _set(corner, f4, b, m, d)
        _link(twin, 3 * f1, 3 * f2)
        _link(twin, 3 * f3, 3 * f4)
        _link(twin, 3 * f1 + 1, 3 * f3 + 2)
        _link(twin, 3 * f2 + 2, 3 * f4 + 1)
        _link(twin, 3 * f1 + 2, ta)
        _link(twin, 3 * f3 + 1, tb)
        _link(twin, 3 * f2 + 1, sa)
        _link(twin, 3 * f4 + 2, sb)
        out[a], out[b], out[c], out[d], out[m] = 3 * f1, 3 * f3 + 1, 3 * f1 + 2, 3 * f2 + 2, 3 * f3
    return n_vertices, n_faces


@njit(cache=True)
def _fan_allows(a, skip1, skip2, p, x, edges, longest):  # type: ignore[no-untyped-def]
    """Whether vertex a may move to p: no triangle around it turns over, no edge grows too long."""
    corner, twin, out = edges
    h = out[a]
    while True:
        if h // 3 != skip1 and h // 3 != skip2:
            q, r = x[corner[_next(h)]], x[corner[_previous(h)]]
            if (q - p) @ (q - p) > longest**2:
                return False
            old, new = _normal(x[a], q, r), _normal(p, q, r)
            size = np.sqrt((old @ old) * (new @ new))
            if old @ new <= FLATNESS * size:
                return False
        h = twin[_previous(h)]
        if h == out[a]:
            return True


@njit(cache=True)
def _may_collapse(h, p, x, edges, longest):  # type: ignore[no-untyped-def]
    corner, twin, out = edges
    t = twin[h]
    a, b, c, d = corner[h], corner[_next(h)], corner[_previous(h)], corner[_previous(t)]
    if c == d or _valence(c, twin, out) <= 3 or _valence(d, twin, out) <= 3:
        return False
    g = out[a]
    while True:  # the link condition: a and b share no neighbours but c and d
        v = corner[_next(g)]
        if v not in (b, c, d) and _adjacent(v, b, corner, twin, out):
            return False
        g = twin[_previous(g)]
        if g == out[a]:
            break
    f1, f2 = h // 3, t // 3
    return _fan_allows(a, f1, f2, p, x, edges, longest) and _fan_allows(b, f1, f2, p, x, edges, longest)


@njit(cache=True)
def collapse_short(x, edges, fixed, length, n_faces):  # type: ignore[no-untyped-def]
    """Merge the ends of edges shorter than COLLAPSE times `length`, where the surface stays a manifold."""
    corner, twin, out = edges
    for h in range(3 * n_faces):
        if corner[h] < 0:
            continue
        t = twin[h]
        a, b = corner[h], corner[_next(h)]
        if fixed[a] or _distance(x, a, b) >= COLLAPSE * length:
            continue
        p = x[b].copy() if fixed[b] else 0.5 * (x[a] + x[b])
        if not _may_collapse(h, p, x, edges, SPLIT * length):
            continue
        c, d = corner[_previous(h)], corner[_previous(t)]
        ta, tb, sa, sb = twin[_previous(h)], twin[_next(h)], twin[_next(t)], twin[_previous(t)]
        first = out[a]
        g = first
        while True:
            corner[g] = b
            g = twin[_previous(g)]
            if g == first:
                break
        _link(twin, ta, tb)
        _link(twin, sa, sb)
        _set(corner, h // 3, -1, -1, -1)
        _set(corner, t // 3, -1, -1, -1)
        out[a], out[b], out[c], out[d] = -1, ta, tb, sa
        x[b] = p


@njit(cache=True)
def flip_to_delaunay(x, edges, fixed, n_faces):  # type: ignore[no-untyped-def]
    """One sweep of flips of edges whose opposite angles sum to more than pi; returns how many."""
    corner, twin, out = edges
    count = 0
    for h in range(3 * n_faces):
        if corner[h] < 0 or twin[h] < h:
            continue
        t = twin[h]
        a, b, c, d = corner[h], corner[_next(h)], corner[_previous(h)], corner[_previous(t)]
        if c == d or (fixed[a] and fixed[b]) or not _obtuse(x[a], x[b], x[c], x[d]):
            continue
        if min(_valence(a, twin, out), _valence(b, twin, out)) <= 3 or _adjacent(c, d, corner, twin, out):
            continue
        old = _normal(x[a], x[b], x[c]) + _normal(x[b], x[a], x[d])
        first, second = _normal(x[a], x[d], x[c]), _normal(x[d], x[b], x[c])
        size = np.sqrt(old @ old)
        if (
            min(
                first @ old - FLATNESS * size * np.sqrt(first @ first),
                second @ old - FLATNESS * size * np.sqrt(second @ second),
            )
            <= 0
        ):
            continue
        ta, tb, sa, sb = twin[_previous(h)], twin[_next(h)], twin[_next(t)], twin[_previous(t)]
        f1, f2 = h // 3, t // 3
        _set(corner, f1, a, d, c)
        _set(corner, f2, d, b, c)
        _link(twin, 3 * f1 + 1, 3 * f2 + 2)
        _link(twin, 3 * f1, sa)
        _link(twin, 3 * f1 + 2, ta)
        _link(twin, 3 * f2, sb)
        _link(twin, 3 * f2 + 1, tb)
        out[a], out[b], out[c], out[d] = 3 * f1, 3 * f2 + 1, 3 * f1 + 2, 3 * f2
        count += 1
    return count


@njit(cache=True)
def _obtuse(a, b, c, d):  # type: ignore[no-untyped-def]
    """Whether the angles at c and d of the triangles a b c and b a d sum to more than pi, with a margin."""
    u, v, p, q = a - c, b - c, a - d, b - d
    uv, pq = np.cross(u, v), np.cross(p, q)
    sine_c, sine_d = np.sqrt(uv @ uv), np.sqrt(pq @ pq)
    scale = np.sqrt((u @ u) * (v @ v) * (p @ p) * (q @ q))
    return sine_c * (p @ q) + (u @ v) * sine_d < -1e-9 * scale
