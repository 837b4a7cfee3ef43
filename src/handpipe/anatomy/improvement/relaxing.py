"""Moves of single vertices in a labelled mesh: towards better tets, and towards smooth borders of labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import sparse

from handpipe.anatomy.improvement.stars import BETTER, Stars, least_sine
from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.tets import FACES

TURN_OUTER = np.sin(np.radians(1.0)) ** 2  # of faces that count as one plane: the domain's boundary,
TURN_INNER = np.sin(np.radians(40.0)) ** 2  # borders of labels
APPROACHES = 3  # to the smooth border, for vertices that other vertices block at first
TRIALS = 24  # directions in which a vertex is tried
REACHES = (0.3, 0.15, 0.07, 0.03)  # of a trial move, as a share of the shortest edge at the vertex
DIRECTIONS = np.random.default_rng(0).standard_normal((TRIALS, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)

FIXED = 1e9  # eigenvalue of a fixed direction, over the limit
STUCK = 0.1  # of a free direction, in its largest entry: a vertex with less stays


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces (f, 3) of the domain's boundary (`outer`) and between two labels; each once."""

    corners: IntArray
    outer: BoolArray

    @staticmethod
    def classify(tets: IntArray, labels: IntArray) -> Faces:
        """Of labelled tets."""
        faces = tets[:, FACES].reshape(-1, 3)
        sorted_faces = np.sort(faces, axis=1)
        order = np.lexsort(sorted_faces.T[::-1])
        same = (sorted_faces[order[1:]] == sorted_faces[order[:-1]]).all(axis=1)
        first, second = order[:-1][same], order[1:][same]
        between = first[labels[first // 4] != labels[second // 4]]
        alone = np.ones(len(faces), dtype=bool)
        alone[first] = alone[second] = False
        outer = np.flatnonzero(alone)
        corners = faces[np.concatenate([outer, between])]
        return Faces(corners, np.arange(len(corners)) < len(outer))

    def free_directions(self, x: Array) -> Array:
        """Projections (n, 3, 3) onto the directions in which a vertex may move along all its faces.

        A vertex without faces is free; one on a surface moves within its tangent plane, one on a line where
        surfaces meet along it, others not at all.
        """
        a, b, c = np.moveaxis(x[self.corners], 1, 0)
        normal = np.cross(b - a, c - a)
        squared = np.maximum(np.einsum("fi,fi->f", normal, normal), 1e-300)
        size = np.where(
            self.outer, squared, np.sqrt(squared)
        )  # small faces of the domain count as much as large
        tensor = normal[:, :, None] * normal[:, None, :] / size[:, None, None]
        free = np.broadcast_to(np.eye(3), (len(x), 3, 3)).copy()
        for outer, turn in ((True, TURN_OUTER), (False, TURN_INNER)):
            against = np.zeros((len(x), 3, 3))
            mine = self.outer == outer
            np.add.at(against, self.corners[mine], tensor[mine][:, None])
            used = np.unique(self.corners[mine])
            before = free[used]
            limit = turn * np.linalg.eigvalsh(against[used])[:, -1:, None]
            # A fixed direction stays fixed exactly: its eigenvalues are far above the limit.
            sums = before @ against[used] @ before / limit + FIXED * (np.eye(3) - before)
            values, axes = np.linalg.eigh(sums)
            free[used] = (axes * (values <= 1)[:, None]) @ np.swapaxes(axes, 1, 2)
        return free


def improve_vertices(
    x: Array, tets: IntArray, stars: Stars, free: Array, chosen: IntArray, fixed_mask: BoolArray
) -> int:
    """Move the chosen vertices, in place, to where the worst of their tets is best; returns how many moved.

    Trial moves are projected by `free` (n, 3, 3); the vertices marked in `fixed_mask` (n,) stay.
    """
    return int(_improve(x, tets, stars, free, chosen, fixed_mask))


@njit(cache=True)
def _improve(x, tets, stars, free, chosen, fixed_mask):  # type: ignore[no-untyped-def]
    moved = 0
    for v in chosen:
        if fixed_mask[v] or np.abs(free[v]).max() < STUCK:
            continue
        best, shortest = _star_value(v, x, tets, stars)
        first = best
        origin = x[v].copy()
        at = origin.copy()
        for reach in REACHES:
            for d in range(len(DIRECTIONS)):
                x[v] = at + reach * shortest * (free[v] @ DIRECTIONS[d])
                value, _ = _star_value(v, x, tets, stars)
                if value > best * BETTER:
                    best = value
                    at = x[v].copy()
                x[v] = at
        moved += best > first
    return moved


@njit(cache=True)
def _star_value(v, x, tets, stars):  # type: ignore[no-untyped-def]
    """Least sine in the star of a vertex, and its shortest edge."""
    low, shortest = 2.0, np.inf
    for k in range(stars.start[v], stars.start[v + 1]):
        c = tets[stars.tets[k]]
        low = min(low, least_sine(x[c[0]], x[c[1]], x[c[2]], x[c[3]]))
        for i in range(4):
            if c[i] != v:
                d = x[c[i]] - x[v]
                shortest = min(shortest, np.sqrt(d @ d))
    return low, shortest


def smooth_borders(
    x: Array, tets: IntArray, labels: IntArray, *, sweeps: int, floor: float, passband: float = 0.1
) -> Array:
    """Vertices (n, 3) with the borders of labels smoothed without shrinking (Taubin 1995).

    Vertices on a border of two labels go towards the mean of their neighbours on it, those on a line where
    more meet along that line; the domain's boundary stays. A move is shortened, or left out, where it would
    make a tet's least sine smaller than `floor` or, if it was below that, smaller than before.
    """
    faces = Faces.classify(tets, labels)
    averaging, moving = _border_averaging(faces, len(x))
    stars = Stars.build(tets, len(x))
    smooth, out = x.copy(), x.copy()
    for _ in range(sweeps):
        for factor in (0.5, 1 / (passband - 2)):
            smooth[moving] += factor * (averaging @ smooth - smooth)[moving]
    for _ in range(APPROACHES):
        _move_guarded(out, smooth - out, tets, stars, moving, floor)
    return out


def _border_averaging(faces: Faces, n: int) -> tuple[sparse.csr_matrix, IntArray]:
    """Matrix (n, n) of means over neighbours on the same border or line, and the vertices that may move."""
    border = faces.corners[~faces.outer]
    edges, counts = np.unique(
        np.sort(np.concatenate([border[:, [0, 1]], border[:, [1, 2]], border[:, [2, 0]]]), axis=1),
        axis=0,
        return_counts=True,
    )
    on_line = np.zeros(n, dtype=bool)
    on_line[edges[counts != 2]] = True
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    along = np.concatenate([counts, counts]) != 2
    kept = ~on_line[rows] | along
    rows, columns = rows[kept], columns[kept]
    adjacency = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    movable = degree > 0
    movable[faces.corners[faces.outer]] = False
    movable[on_line & (degree != 2)] = False  # ends of lines and points where several meet
    scale = sparse.diags(1 / np.maximum(degree, 1))
    return (scale @ adjacency).tocsr(), np.flatnonzero(movable)


@njit(cache=True)
def _move_guarded(x, step, tets, stars, moving, floor):  # type: ignore[no-untyped-def]
    for v in moving:
        before, _ = _star_value(v, x, tets, stars)
        least = min(before, floor)
        origin = x[v].copy()
        share = 1.0
        for _ in range(3):
            x[v] = origin + share * step[v]
            value, _ = _star_value(v, x, tets, stars)
            if value >= least:
                break
            x[v] = origin
            share *= 0.5
