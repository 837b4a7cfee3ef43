"""Bisection of marked edges in all tets around them: conforming for any marks, by one order of the edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.tets import EDGES

LOW, HIGH = EDGES[:, 0].copy(), EDGES[:, 1].copy()


@dataclass(frozen=True, eq=False)
class MarkedEdges:
    """Marked edges (e, 2) of tets, and the index of each tet's six edges among them (c, 6), -1 unmarked."""

    ends: IntArray
    of_tet: IntArray

    @staticmethod
    def number(tets: IntArray, marked: BoolArray, n_vertices: int) -> MarkedEdges:
        """From marks (c, 6) of the edges of tets (c, 4), in the order of `EDGES`."""
        ends = np.sort(tets[:, EDGES][marked], axis=1)
        keys, inverse = np.unique(ends[:, 0] * n_vertices + ends[:, 1], return_inverse=True)
        of_tet = np.full(marked.shape, -1)
        of_tet[marked] = inverse.reshape(-1)
        return MarkedEdges(np.stack([keys // n_vertices, keys % n_vertices], axis=1), of_tet)

    def in_all(self, tets: IntArray, n_vertices: int) -> MarkedEdges:
        """The same edges wherever they are in tets (m, 4)."""
        keys = self.ends @ [n_vertices, 1]
        ends = np.sort(tets[:, EDGES], axis=2) @ [n_vertices, 1]
        place = np.minimum(np.searchsorted(keys, ends), len(keys) - 1)
        return MarkedEdges(self.ends, np.where(keys[place] == ends, place, -1))

    def ranks(self, vertices: Array) -> IntArray:
        """The order (e,) in which the edges are bisected: long ones first, by their vertices among equals."""
        squared = ((vertices[self.ends[:, 1]] - vertices[self.ends[:, 0]]) ** 2).sum(axis=1)
        ranks = np.empty(len(squared), dtype=np.int64)
        ranks[np.argsort(-squared, kind="stable")] = np.arange(len(squared))
        return ranks


def bisect(tets: IntArray, edges: MarkedEdges, ranks: IntArray, first_new: int) -> tuple[IntArray, IntArray]:
    """Tets (d, 4) that replace tets (c, 4), and the parent (d,) of each.

    Edge i gets the vertex first_new + i. Every marked edge of a tet is bisected in the order of the ranks.
    What happens on a face depends on the order of its own edges alone, so that both its tets cut it alike.
    Orientations are kept.
    """
    return _bisect(tets, edges.of_tet, ranks, first_new)


@njit(cache=True)
def _bisect(tets, of_tet, ranks, first_new):  # type: ignore[no-untyped-def]
    children = np.empty((8 * len(tets), 4), np.int64)
    parents = np.empty(8 * len(tets), np.int64)
    count = 0
    for t in range(len(tets)):
        start = count
        children[count], parents[count] = tets[t], t
        count += 1
        done = -1
        while True:
            edge, rank = -1, len(ranks)
            for i in range(6):
                e = of_tet[t, i]
                if e >= 0 and done < ranks[e] < rank:
                    edge, rank = i, ranks[e]
            if edge < 0:
                break
            done = rank
            a, b = tets[t, LOW[edge]], tets[t, HIGH[edge]]
            for c in range(start, count):
                at_a, at_b = -1, -1
                for i in range(4):
                    if children[c, i] == a:
                        at_a = i
                    elif children[c, i] == b:
                        at_b = i
                if at_a >= 0 and at_b >= 0:
                    children[count], parents[count] = children[c], t
                    children[count, at_a] = first_new + of_tet[t, edge]
                    children[c, at_b] = first_new + of_tet[t, edge]
                    count += 1
    return children[:count].copy(), parents[:count].copy()
