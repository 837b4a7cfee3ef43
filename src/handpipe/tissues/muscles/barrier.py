"""Muscles that penetrate no body: pushed apart where they do, then at rest behind a barrier."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from handpipe.core import Array, ConvergenceError
from handpipe.fem.contact import Contact, ConvexBarrier
from handpipe.fem.minimisation import Equilibrium
from handpipe.fem.potentials import Potential
from handpipe.fem.solver import Limits, NearEnough, Settled, settle
from handpipe.mesh.contact import ways_out
from handpipe.mesh.surfaces import barycentric_matrix
from handpipe.tissues.muscles.colliding import Bodies, Crossings

log = logging.getLogger(__name__)

DISTANCE = 0.1  # mm within which bodies repel behind the barrier: a tenth of the muscles' edges
BARRIER_STIFFNESS = 16.0  # times Young's modulus: pressed bodies keep a few hundredths of a mm
MARGIN, GROWTH = 0.1, 0.05  # mm beyond a body to which muscles are pushed; its growth a round
ROUNDS = 6  # of pushes, at most
REMEDY = "The pose may leave no room for the muscles: bend less, or scan a pose near it."


@dataclass(frozen=True)
class MusclesInFrame:
    """Muscles in a frame.

    name: in log lines; rest (n, 3): neutral mesh vertices; young: modulus in kPa; push: stiffness in mN/mm of
    a crossing's push; planes: contact planes at x (n, 3) with a margin in mm, or sliding alone for None;
    solve: equilibrium near a start (n, 3) under a contact, exactly or as a start of another.
    """

    name: str
    bodies: Bodies
    rest: Array
    young: float
    push: float
    planes: Callable[[Array, float | None], list[Potential]]
    solve: Callable[[list[Potential], Array, bool], Equilibrium]


def kept_apart(muscles: MusclesInFrame, settled: Settled, limits: Limits) -> Settled:
    """The equilibrium behind a barrier, near one with contact planes.

    Raises
    ------
    ConvergenceError
        Where muscles cannot be pushed apart, or have no equilibrium behind the barrier.
    """
    start = _pushed_apart(muscles, settled.x)
    stiffness = BARRIER_STIFFNESS * muscles.young
    barrier = ConvexBarrier(muscles.bodies.barrier(start, muscles.rest, DISTANCE, stiffness))
    free = [start]

    def in_place(planes: Array, _: NearEnough | None) -> Equilibrium:
        found = muscles.solve([*muscles.planes(planes, None), barrier], free[-1], True)
        free.append(found.x)
        return found

    found = settle(in_place, start, limits, f"{muscles.name}, behind a barrier")
    left = muscles.bodies.crossings(found.x, itself=True)
    if len(left.edges):
        raise no_room(muscles.name, muscles.bodies, found.x, left)
    return replace(found, renewals=settled.renewals + found.renewals)


def _pushed_apart(muscles: MusclesInFrame, x: Array) -> Array:
    """Positions near x (n, 3) at which no bodies cross."""
    for count in range(ROUNDS + 1):
        found = muscles.bodies.crossings(x, itself=True)
        log.info("%s: %d crossings after %d pushes", muscles.name, len(found.edges), count)
        if not len(found.edges):
            return x
        if count < ROUNDS:
            margin = MARGIN + GROWTH * count
            x = muscles.solve([*muscles.planes(x, margin), _push(muscles, x, found, margin)], x, False).x
    raise no_room(muscles.name, muscles.bodies, x, found)


def _push(muscles: MusclesInFrame, x: Array, found: Crossings, margin: float) -> Contact:
    """Contact of the places where edges cross triangles, along the difference of the two sheets' normals."""
    bodies, surface = muscles.bodies, muscles.bodies.surface(x)
    on_edges = _on_edges(surface.vertices, found)
    feet = barycentric_matrix(on_edges @ surface.vertices, found.triangles, surface.vertices)
    normals = surface.vertex_normals()
    a, b, c = np.moveaxis(surface.vertices[found.triangles], 1, 0)
    own = np.cross(b - a, c - a)
    own /= np.linalg.norm(own, axis=1, keepdims=True)
    directions = ways_out(feet @ normals - on_edges @ normals, own)
    apart = sparse.csr_matrix(on_edges - feet)
    of_bones = apart[:, bodies.count :] @ bodies.bones[0]  # which do not move
    moving = apart[:, : bodies.count] @ bodies.operator
    return Contact(moving, margin * directions - of_bones, directions, muscles.push)


def _on_edges(points: Array, found: Crossings) -> sparse.csr_matrix:
    """Weights (c, v) of points that are the places where edges cross triangles."""
    a, b, c = np.moveaxis(points[found.triangles], 1, 0)
    heights = np.einsum("nki,ni->nk", points[found.edges] - a[:, None], np.cross(b - a, c - a))
    share = heights[:, 0] / (heights[:, 0] - heights[:, 1])
    rows = np.repeat(np.arange(len(share)), 2)
    weights = np.column_stack([1 - share, share]).ravel()
    return sparse.csr_matrix((weights, (rows, found.edges.ravel())), shape=(len(share), len(points)))


def no_room(name: str, bodies: Bodies, x: Array, found: Crossings) -> ConvergenceError:
    """Bodies cross with mesh vertices at x (n, 3)."""
    return ConvergenceError(name, bodies.place(x, found), REMEDY)
