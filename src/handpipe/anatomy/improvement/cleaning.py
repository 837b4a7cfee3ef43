"""Labels of a tet mesh without crumbs and pinches: each label's surface a manifold, its loose crumbs gone."""

from __future__ import annotations

import logging

import numpy as np
from numba import njit

from handpipe.anatomy.improvement.stars import Stars
from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.tets import EDGES, FACES, TetMesh, tet_neighbours, tet_pieces

log = logging.getLogger(__name__)

CRUMB = 0.05  # of a label's largest part, in volume, below which a part goes to its neighbours
ROUNDS = 50  # rounds at most
GENTLE_ROUNDS = 15  # after which all tets at a pinch get one label, since tets may change labels for ever


def cleaned(mesh: TetMesh, labels: IntArray, crumb: float = CRUMB) -> IntArray:
    """Labels (m,) without small loose parts, and without parts that hang together at a vertex or edge only.

    A part of a label that touches the rest in a vertex or edge takes, tet by tet there, the label across its
    largest face.
    """
    pairs = tet_neighbours(mesh.tets)
    area = _shared_areas(mesh, pairs)
    volumes = mesh.volumes()
    for number in range(ROUNDS):
        labels = _without_crumbs(labels, pairs, area, volumes, crumb)
        pinched, filled = _pinched(mesh, labels, pairs, volumes)
        if not pinched.any():
            return labels
        labels = _given_away(labels, pinched, pairs, area) if number < GENTLE_ROUNDS else filled
    log.warning("%d tets still share only vertices or edges with their part", pinched.sum())
    return labels


def _shared_areas(mesh: TetMesh, pairs: IntArray) -> Array:
    """Areas (p,) in mm^2 of the faces between pairs of tets."""
    first, second = mesh.tets[pairs[:, 0]], mesh.tets[pairs[:, 1]]
    apex = np.argmin((first[:, :, None] == second[:, None]).any(axis=2), axis=1)
    a, b, c = np.moveaxis(mesh.vertices[np.take_along_axis(first, FACES[apex], axis=1)], 1, 0)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _without_crumbs(labels: IntArray, pairs: IntArray, area: Array, volumes: Array, share: float) -> IntArray:
    part = label_parts(labels, pairs)
    size = np.bincount(part, volumes)
    label = np.zeros(len(size), dtype=np.int64)
    label[part] = labels
    largest = np.zeros(label.max() + 1)
    np.maximum.at(largest, label, size)
    crumb = (size < share * largest[label])[part]
    return _given_away(labels, crumb, pairs, area) if crumb.any() else labels


def label_parts(labels: IntArray, pairs: IntArray) -> IntArray:
    """The part (m,) that each tet belongs to.

    A part is a set of tets of one label that are connected by faces; `pairs` are those of `tet_neighbours`.
    """
    same = pairs[labels[pairs[:, 0]] == labels[pairs[:, 1]]]
    return tet_pieces(len(labels), same)


def _given_away(labels: IntArray, given: BoolArray, pairs: IntArray, area: Array) -> IntArray:
    """Labels (m,) in which the tets `given` have the label of a neighbour.

    A tet takes the other label that it shares the largest area with. The tets on the outside of a crumb come
    first, then those behind them.
    """
    labels, given = labels.copy(), given.copy()
    ends, others = np.concatenate([pairs, pairs[:, ::-1]]).T
    areas = np.concatenate([area, area])
    while given.any():
        outside = given[ends] & ~given[others] & (labels[ends] != labels[others])
        tet, label, face = ends[outside], labels[others[outside]], areas[outside]
        if len(tet) == 0:
            break
        order = np.lexsort([face, tet])
        last = np.concatenate([tet[order][1:] != tet[order][:-1], [True]])
        labels[tet[order][last]] = label[order][last]
        given[tet] = False
    return labels


def _pinched(mesh: TetMesh, labels: IntArray, pairs: IntArray, volumes: Array) -> tuple[BoolArray, IntArray]:
    """Tets (m,) that pinch their label at a vertex or edge, and the labels (m,) that would fill these places.

    Such a tet is not connected, by faces at this vertex or edge, to the largest part of its label there.
    """
    touching = np.zeros(len(mesh.vertices), dtype=bool)
    differ = pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]]
    touching[mesh.tets[differ]] = True
    vertices = np.flatnonzero(touching)
    stars = Stars.build(mesh.tets, len(mesh.vertices))
    out, filled = np.zeros(len(labels), dtype=bool), labels.copy()
    lone = np.full(len(vertices), -1)
    _mark(np.stack([vertices, lone], axis=1), mesh.tets, labels, volumes, stars, out, filled)
    ends = mesh.tets[:, EDGES]
    edges = np.unique(np.sort(ends[touching[ends].all(axis=2)], axis=1), axis=0)
    _mark(edges, mesh.tets, labels, volumes, stars, out, filled)
    return out, filled


@njit(cache=True)
def _mark(simplices, tets, labels, volumes, stars, out, filled):  # type: ignore[no-untyped-def]
    """Mark the smaller parts of labels at vertices (second number -1) or edges.

    `filled` gives all tets of such a place the label of the largest part there.
    """
    for index in range(len(simplices)):
        v, w = simplices[index]
        group = stars.tets[stars.start[v] : stars.start[v + 1]]
        if w >= 0:
            group = np.array([t for t in group if (tets[t] == w).any()])
        n = len(group)
        part = np.arange(n)
        for i in range(n):  # parts by union of all pairs that share a face
            for j in range(i):
                if labels[group[i]] == labels[group[j]] and part[i] != part[j]:
                    shared = 0
                    for a in range(4):
                        for b in range(4):
                            shared += tets[group[i], a] == tets[group[j], b]
                    if shared == 3:
                        old, new = part[i], part[j]
                        for k in range(n):
                            if part[k] == old:
                                part[k] = new
        size = np.zeros(n)
        for i in range(n):
            size[part[i]] += volumes[group[i]]
        pinched = False
        for i in range(n):
            for j in range(n):
                smaller = size[part[i]] < size[part[j]] or (
                    size[part[i]] == size[part[j]] and part[i] < part[j]
                )
                if labels[group[i]] == labels[group[j]] and smaller:
                    out[group[i]] = True
                    pinched = True
        if pinched:
            label = labels[group[np.argmax(size[part])]]
            for i in range(n):
                filled[group[i]] = label
