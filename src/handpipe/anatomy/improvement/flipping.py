"""Flips that put better tets in the place of bad ones, inside one label: edge removal and its opposite."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from handpipe.anatomy.improvement.stars import BETTER, Stars, least_sine
from handpipe.core import Array, IntArray

LARGEST_RING = 7  # tets around an edge that a flip removes, at most
SPARE = 2 * (LARGEST_RING - 2) - LARGEST_RING  # tets that one flip adds at most


class _Mesh(NamedTuple):
    """Vertices x (n, 3), tets (m, 4) and the label (m,) of each."""

    x: Array
    tets: IntArray
    labels: IntArray


class _Ring(NamedTuple):
    """Surroundings of an edge: vertices in order, and the numbers of the tets."""

    vertices: IntArray
    tets: IntArray


def flip_bad(
    x: Array, tets: IntArray, labels: IntArray, worst_first: IntArray, stars: Stars
) -> tuple[IntArray, IntArray, int]:
    """Tets and labels after flips at the tets listed, and the number of flips; removed tets have corners -1.

    An edge inside one label with up to seven tets around it is replaced by a fan across them, or a face by an
    edge (2 to 3), whichever makes the worst tet best. Each vertex takes part once a call.
    """
    room = SPARE * len(worst_first)
    tets = np.concatenate([tets, np.full((room, 4), -1)])
    labels = np.concatenate([labels, np.zeros(room, dtype=labels.dtype)])
    count = _flip_bad(_Mesh(x, tets, labels), worst_first, stars, len(labels) - room)
    return tets, labels, int(count)


@njit(cache=True)
def _flip_bad(mesh, listed, stars, n_tets):  # type: ignore[no-untyped-def]
    x, tets, labels = mesh
    locked = np.zeros(len(x), np.bool_)
    ring = _Ring(np.empty(LARGEST_RING, np.int64), np.empty(LARGEST_RING, np.int64))
    best_ring = _Ring(np.empty(LARGEST_RING, np.int64), np.empty(LARGEST_RING, np.int64))
    count = 0
    for index in range(len(listed)):
        t = listed[index]
        if tets[t, 0] < 0:
            continue
        c = tets[t].copy()
        if locked[c[0]] or locked[c[1]] or locked[c[2]] or locked[c[3]]:
            continue
        best, best_p, best_q, best_n, best_fan = least_sine(x[c[0]], x[c[1]], x[c[2]], x[c[3]]), -1, -1, 0, -1
        for i in range(4):
            for j in range(i + 1, 4):
                p, q = c[i], c[j]
                n = _ring(p, q, mesh, stars, locked, ring)
                for fan in range(n):
                    value = _fan_value(p, q, x, ring.vertices, n, fan)
                    if value > best * BETTER:
                        best, best_p, best_q, best_n, best_fan = value, p, q, n, fan
                        best_ring.vertices[:], best_ring.tets[:] = ring.vertices, ring.tets
        if best_fan >= 0:
            n_tets = _remove_edge(best_p, best_q, mesh, best_ring, best_n, best_fan, n_tets)
            count += 1
            locked[best_p] = locked[best_q] = True
            for k in range(best_n):
                locked[best_ring.vertices[k]] = True
            continue
        for i in range(4):
            other, apex = _across(t, i, tets, stars)
            if other < 0 or labels[other] != labels[t] or locked[apex]:
                continue
            value = _edge_value(c[i], apex, c, i, x)
            if value > best * BETTER:
                best, best_p, best_q, best_n = value, i, apex, other
        if best_q >= 0:
            _insert_edge(t, best_n, best_p, best_q, c, mesh, n_tets)
            n_tets += 1
            count += 1
            locked[best_q] = True
            for i in range(4):
                locked[c[i]] = True
    return count


@njit(cache=True)
def _ring(p, q, mesh, stars, locked, out):  # type: ignore[no-untyped-def]
    """Number of tets around the edge p, q inside one label, 0 if none; `out` takes its surroundings."""
    x, tets, labels = mesh
    ring, old = out
    n = 0
    first, second = np.empty(LARGEST_RING, np.int64), np.empty(LARGEST_RING, np.int64)
    for k in range(stars.start[p], stars.start[p + 1]):
        t = stars.tets[k]
        at_p, at_q = -1, -1
        for i in range(4):
            if tets[t, i] == p:
                at_p = i
            elif tets[t, i] == q:
                at_q = i
        if at_q < 0:
            continue
        if n == LARGEST_RING or (n > 0 and labels[t] != labels[old[0]]):
            return 0
        r, s = -1, -1
        for i in range(4):
            if i != at_p and i != at_q:
                if locked[tets[t, i]]:
                    return 0
                if r < 0:
                    r = tets[t, i]
                else:
                    s = tets[t, i]
        side = np.cross(x[q] - x[p], x[r] - x[p]) @ (x[s] - x[p])
        first[n], second[n] = (r, s) if side > 0 else (s, r)
        old[n] = t
        n += 1
    if n < 3:
        return 0
    ring[0] = first[0]
    at = second[0]
    for k in range(1, n):
        ring[k] = at
        following = -1
        for m in range(n):
            if first[m] == at:
                following = second[m]
        if following < 0:
            return 0
        at = following
    return n if at == ring[0] else 0


@njit(cache=True)
def _fan_value(p, q, x, ring, n, fan):  # type: ignore[no-untyped-def]
    low = 2.0
    apex = x[ring[fan]]
    for k in range(1, n - 1):
        u, v = x[ring[(fan + k) % n]], x[ring[(fan + k + 1) % n]]
        low = min(low, least_sine(apex, u, v, x[q]), least_sine(apex, v, u, x[p]))
        if low <= 0:
            break
    return low


@njit(cache=True)
def _remove_edge(p, q, mesh, around, n, fan, n_tets):  # type: ignore[no-untyped-def]
    tets, labels = mesh.tets, mesh.labels
    ring, old = around
    label = labels[old[0]]
    for k in range(n):
        tets[old[k]] = -1
    used = 0
    apex = ring[fan]
    for k in range(1, n - 1):
        u, v = ring[(fan + k) % n], ring[(fan + k + 1) % n]
        for side in range(2):
            slot = old[used] if used < n else n_tets
            if used >= n:
                n_tets += 1
            used += 1
            labels[slot] = label
            tets[slot, 0] = apex
            tets[slot, 1], tets[slot, 2], tets[slot, 3] = (u, v, q) if side == 0 else (v, u, p)
    return n_tets


@njit(cache=True)
def _across(t, i, tets, stars):  # type: ignore[no-untyped-def]
    """The tet on the other side of the face opposite to corner i of tet t, and its vertex off the face.

    Both are -1 where there is no neighbour.
    """
    a, b, c = tets[t, (i + 1) % 4], tets[t, (i + 2) % 4], tets[t, (i + 3) % 4]
    for k in range(stars.start[a], stars.start[a + 1]):
        s = stars.tets[k]
        if s == t:
            continue
        shared, apex = 0, -1
        for j in range(4):
            v = tets[s, j]
            if v in (a, b, c):
                shared += 1
            else:
                apex = v
        if shared == 3:
            return s, apex
    return -1, -1


@njit(cache=True)
def _face(c, i):  # type: ignore[no-untyped-def]
    """The corners other than i of a tet, counter-clockwise seen from outside."""
    if i == 0:
        return c[1], c[2], c[3]
    if i == 1:
        return c[0], c[3], c[2]
    if i == 2:
        return c[0], c[1], c[3]
    return c[0], c[2], c[1]


@njit(cache=True)
def _edge_value(p, q, c, i, x):  # type: ignore[no-untyped-def]
    u, v, w = _face(c, i)
    low = least_sine(x[p], x[q], x[u], x[v])
    return min(low, least_sine(x[p], x[q], x[v], x[w]), least_sine(x[p], x[q], x[w], x[u]))


@njit(cache=True)
def _insert_edge(t, other, i, q, c, mesh, n_tets):  # type: ignore[no-untyped-def]
    tets, labels = mesh.tets, mesh.labels
    u, v, w = _face(c, i)
    p = c[i]
    tets[t, 0], tets[t, 1], tets[t, 2], tets[t, 3] = p, q, u, v
    tets[other, 0], tets[other, 1], tets[other, 2], tets[other, 3] = p, q, v, w
    tets[n_tets, 0], tets[n_tets, 1], tets[n_tets, 2], tets[n_tets, 3] = p, q, w, u
    labels[n_tets] = labels[t]
