"""A labelled tet mesh made fit for simulation: smooth borders between labels, no small dihedral angles.

Moves of vertices, edge collapses and flips, each only where it makes the worst tet around it better (as
Klingner and Shewchuk 2007 do). Vertices stay in their region, on their border between two regions, or on
their line where several meet. The caller names fixed vertices of the domain's boundary; its other vertices
move within flat parts of it.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from handpipe.anatomy.improvement.collapsing import collapse_bad
from handpipe.anatomy.improvement.flipping import flip_bad
from handpipe.anatomy.improvement.relaxing import Faces, improve_vertices, smooth_borders
from handpipe.anatomy.improvement.stars import MOST_LABELS, Stars, least_sines, regions_at_vertices
from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.mesh.tets import TetMesh

log = logging.getLogger(__name__)

STALE = 4  # rounds without a new least number of small angles, after which the search stops
FLOOR = 12.0  # deg below which smoothing brings no dihedral angle


@dataclass(frozen=True, eq=False)
class Labelled:
    """A conforming tet mesh with one label (m,) a tet."""

    mesh: TetMesh
    labels: IntArray


def improve(
    labelled: Labelled, fixed: IntArray, *, sweeps: int = 5, target: float = 10.0, rounds: int = 20
) -> Labelled:
    """Smooth the borders in so many sweeps, then repair dihedral angles below `target` degrees.

    `fixed` vertices keep their places and come first in the result, in their order. The repair stops when no
    angle is below the target, when a few rounds have not helped, or at the limit of rounds.
    """
    if labelled.labels.max() >= MOST_LABELS:
        problem = f"go up to {labelled.labels.max()}"
        raise InputError("improve", "labels", problem, f"Use numbers below {MOST_LABELS}")
    tets, labels = labelled.mesh.tets.copy(), labelled.labels.copy()
    x = smooth_borders(
        labelled.mesh.vertices, tets, labels, sweeps=sweeps, floor=float(np.sin(np.radians(FLOOR)))
    )
    fixed_mask = np.zeros(len(x), dtype=bool)
    fixed_mask[fixed] = True
    bound = float(np.sin(np.radians(target)))
    fewest, stale = len(tets) + 1, 0
    for number in range(rounds):
        quality = least_sines(x, tets)
        bad = int((quality < bound).sum())
        log.info("round %d: %d of %d tets below %g deg", number, bad, len(tets), target)
        fewest, stale = min(bad, fewest), 0 if bad < fewest else stale + 1
        if bad == 0 or stale > STALE:
            break
        tets, labels, changes = _round(x, tets, labels, fixed_mask, bound)
        if changes == 0:
            break
    order = np.concatenate([fixed, np.setdiff1d(np.unique(tets), fixed)])
    place = np.full(len(x), -1)
    place[order] = np.arange(len(order))
    return Labelled(TetMesh(x[order], place[tets]), labels)


def _round(
    x: Array, tets: IntArray, labels: IntArray, fixed_mask: BoolArray, bound: float
) -> tuple[IntArray, IntArray, int]:
    """One pass of each operation; x changes in place."""
    stars = Stars.build(tets, len(x))
    faces = Faces.classify(tets, labels)
    listed = _worst_first(x, tets, bound)
    changes = improve_vertices(x, tets, stars, faces.free_directions(x), np.unique(tets[listed]), fixed_mask)
    regions = regions_at_vertices(tets, labels, faces.corners[faces.outer], len(x))
    collapses = collapse_bad(x, tets, labels, regions, fixed_mask, _worst_first(x, tets, bound), stars)
    tets, labels = _present(tets, labels)
    tets, labels, flips = flip_bad(x, tets, labels, _worst_first(x, tets, bound), Stars.build(tets, len(x)))
    tets, labels = _present(tets, labels)
    log.debug("%d moves, %d collapses, %d flips", changes, collapses, flips)
    return tets, labels, changes + collapses + flips


def _worst_first(x: Array, tets: IntArray, bound: float) -> IntArray:
    quality = least_sines(x, tets)
    listed = np.flatnonzero(quality < bound)
    return listed[np.argsort(quality[listed], kind="stable")]


def _present(tets: IntArray, labels: IntArray) -> tuple[IntArray, IntArray]:
    there = tets[:, 0] >= 0
    return tets[there], labels[there]
