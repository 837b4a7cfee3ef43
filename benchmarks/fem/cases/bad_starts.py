"""The rest shape, from starts that have nothing of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ONE_STEP, YOUNG, Outcome, case, largest, without_rigid_motion
from benchmarks.fem.scenes import Body
from handpipe.core import Array, BoolArray
from handpipe.fem.elements import Material
from handpipe.fem.linear.nullspace import rigid_pins
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import solve

STARTS: dict[str, tuple[str, Callable[[Array], Array]]] = {
    "scrambled": ("all vertices at random in the bounding box", scenes.scrambled),
    "plane": ("all vertices on a plane", scenes.onto_plane),
    "point": ("all vertices on a point", scenes.onto_point),
    "mirrored": ("the mirror image", scenes.mirrored),
    "inside-out": ("turned inside out", scenes.inside_out),
}


def rest_from(start: Array, body: Body, fixed: BoolArray, free_body: bool) -> Outcome:
    elastic = Elastic(body.vertices, body.tets, Material(YOUNG, 0.45))
    found = solve([elastic], start, fixed=fixed, options=ONE_STEP)
    if free_body:
        error, answer = without_rigid_motion(found.x, body.vertices), "rest shape but for a rigid motion"
    else:
        error, answer = largest(found.x - body.vertices), "rest shape"
    return Outcome(start, found.x, found.record, elastic, body.triangles, ~fixed, [elastic], error, answer)


def rest_clamped(refine: int, kind: str) -> Outcome:
    body = scenes.box((2.0, 1.0, 1.0), (6 * refine, 3 * refine, 3 * refine))
    clamped = body.where(0, -1.0)
    start = STARTS[kind][1](body.vertices)
    start[clamped] = body.vertices[clamped]
    return rest_from(start, body, np.repeat(clamped, 3), free_body=False)


def rest_free(refine: int, kind: str) -> Outcome:
    body = scenes.box((2.0, 1.0, 1.0), (6 * refine, 3 * refine, 3 * refine))
    fixed = np.zeros(body.vertices.size, dtype=bool)
    fixed[rigid_pins(body.vertices)] = True
    start = STARTS[kind][1](body.vertices)
    if kind != "point":  # a point meets any pins
        start.reshape(-1)[fixed] = body.vertices.reshape(-1)[fixed]
    return rest_from(start, body, fixed, free_body=True)


def enter_starts() -> None:
    for kind, (what, _) in STARTS.items():
        case(f"rest-clamped-{kind}", f"start: {what}; one end clamped")(partial(rest_clamped, kind=kind))
        case(f"rest-free-{kind}", f"start: {what}; nothing clamped")(partial(rest_free, kind=kind))


enter_starts()
