"""Edge collapses that remove bad tets of a labelled mesh.

No vertex moves off its region, border or corner.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.anatomy.improvement.stars import BETTER, OUTSIDE, Stars, least_sine
from handpipe.core import Array, BoolArray, IntArray

OUTER = np.cos(np.radians(1.0))  # cosine by which a face of the domain's boundary may turn
INNER = np.cos(np.radians(35.0))  # and one between two labels


def collapse_bad(
    x: Array,
    tets: IntArray,
    labels: IntArray,
    regions: IntArray,
    fixed: BoolArray,
    worst_first: IntArray,
    stars: Stars,
) -> int:
    """Collapse edges of the tets listed; removed tets get corners -1. Returns the number of collapses.

    A vertex goes to its neighbour only where the edge between lies in the same region, border between
    regions or line where several meet, and where the worst of its tets becomes better. Each vertex takes
    part once a call, since stars are not renewed.
    """
    return int(_collapse_bad(x, tets, labels, regions, fixed, worst_first, stars))


@njit(cache=True)
def _collapse_bad(x, tets, labels, regions, fixed, listed, stars):  # type: ignore[no-untyped-def]
    locked = np.zeros(len(x), np.bool_)
    count = 0
    for index in range(len(listed)):
        t = listed[index]
        if tets[t, 0] < 0:
            continue
        best, best_a, best_b = -1.0, -1, -1
        for i in range(4):
            a = tets[t, i]
            if fixed[a] or _any_locked(a, tets, stars, locked):
                continue
            before = 2.0
            for k in range(stars.start[a], stars.start[a + 1]):
                c = tets[stars.tets[k]]
                before = min(before, least_sine(x[c[0]], x[c[1]], x[c[2]], x[c[3]]))
            for j in range(4):
                b = tets[t, j]
                if i == j or regions[a] & regions[b] != regions[a]:
                    continue
                if _regions_at_edge(a, b, tets, labels, stars) != regions[a]:
                    continue
                after = _after(a, b, x, tets, stars)
                if after <= max(before * BETTER, best):
                    continue
                if _faces_turn(a, b, x, tets, labels, stars):
                    continue
                best, best_a, best_b = after, a, b
        if best_a >= 0:
            _apply(best_a, best_b, tets, stars, locked)
            count += 1
    return count


@njit(cache=True)
def _any_locked(a, tets, stars, locked):  # type: ignore[no-untyped-def]
    if locked[a]:
        return True
    for k in range(stars.start[a], stars.start[a + 1]):
        for i in range(4):
            if locked[tets[stars.tets[k], i]]:
                return True
    return False


@njit(cache=True)
def _regions_at_edge(a, b, tets, labels, stars):  # type: ignore[no-untyped-def]
    """Bits of the labels around an edge, and of the outside where the tets around it do not close."""
    out, sides = np.int64(0), np.int64(0)
    ring = np.empty(2 * (stars.start[a + 1] - stars.start[a]), np.int64)
    n = 0
    for k in range(stars.start[a], stars.start[a + 1]):
        t = stars.tets[k]
        if not _has(tets[t], b):
            continue
        out |= np.int64(1) << labels[t]
        sides += 1
        for i in range(4):
            v = tets[t, i]
            if v in (a, b):
                continue
            new = True
            for j in range(n):
                if ring[j] == v:
                    new = False
            if new:
                ring[n] = v
                n += 1
    return out if n == sides else out | (np.int64(1) << OUTSIDE)


@njit(cache=True, inline="always")
def _has(tet, v):  # type: ignore[no-untyped-def]
    return tet[0] == v or tet[1] == v or tet[2] == v or tet[3] == v


@njit(cache=True)
def _after(a, b, x, tets, stars):  # type: ignore[no-untyped-def]
    """Least sine around a once it has gone to b."""
    low = 2.0
    for k in range(stars.start[a], stars.start[a + 1]):
        c = tets[stars.tets[k]]
        if _has(c, b):
            continue
        p = [c[0], c[1], c[2], c[3]]
        for i in range(4):
            if p[i] == a:
                p[i] = b
        low = min(low, least_sine(x[p[0]], x[p[1]], x[p[2]], x[p[3]]))
        if low <= 0:
            return low
    return low if low < 2.0 else -1.0


@njit(cache=True)
def _faces_turn(a, b, x, tets, labels, stars):  # type: ignore[no-untyped-def]
    """Whether a face at a on the domain's boundary, or between labels, would turn too far."""
    for k in range(stars.start[a], stars.start[a + 1]):
        t = stars.tets[k]
        for i in range(4):
            if tets[t, i] == a:
                continue
            # The face opposite to corner i contains a.
            u, v = -1, -1
            for j in range(4):
                w = tets[t, j]
                if j != i and w != a:
                    if u < 0:
                        u = w
                    else:
                        v = w
            if u == b or v == b:
                continue
            other = -1
            for m in range(stars.start[a], stars.start[a + 1]):
                s = stars.tets[m]
                if s != t and _has(tets[s], u) and _has(tets[s], v):
                    other = s
            if other >= 0 and labels[other] == labels[t]:
                continue
            least = OUTER if other < 0 else INNER
            old = np.cross(x[u] - x[a], x[v] - x[a])
            new = np.cross(x[u] - x[b], x[v] - x[b])
            if old @ new < least * np.sqrt((old @ old) * (new @ new)):
                return True
    return False


@njit(cache=True)
def _apply(a, b, tets, stars, locked):  # type: ignore[no-untyped-def]
    for k in range(stars.start[a], stars.start[a + 1]):
        t = stars.tets[k]
        for i in range(4):
            locked[tets[t, i]] = True
    for k in range(stars.start[a], stars.start[a + 1]):
        t = stars.tets[k]
        if _has(tets[t], b):
            tets[t] = -1
        else:
            for i in range(4):
                if tets[t, i] == a:
                    tets[t, i] = b
