"""Tissue around two bones, of which one turns by 120 degrees."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ACROSS_Y, ONE_STEP, STEPS, YOUNG, Outcome, case, largest
from benchmarks.fem.scenes import Body
from handpipe.core import Array, BoolArray
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import continuation, solve
from handpipe.fem.solver.equilibrium import Record


def joint_scene(refine: int) -> tuple[Body, BoolArray, BoolArray]:
    """Tissue around two bones along x, with a joint space about the origin; the bones' surface vertices."""
    x = np.linspace(-3.0, 3.0, 16 * refine + 1)
    y, z = np.linspace(0.0, 0.45, 2 * refine + 1), np.linspace(-0.45, 0.45, 4 * refine + 1)
    body = scenes.mirrored_in_y(scenes.grid(x, y, z))

    def bones(v: Array) -> BoolArray:
        return (np.abs(v[:, 1:]) < 0.226).all(axis=1) & (np.abs(v[:, 0]) > 1.124)

    body = scenes.without(body, bones(body.vertices))
    bone = bones(body.vertices)
    return body, bone & (body.vertices[:, 0] < 0), bone & (body.vertices[:, 0] > 0)


@lru_cache(maxsize=4)
def bent_in_steps(refine: int) -> tuple[Array, Record]:
    body, proximal, distal = joint_scene(refine)
    elastic = Elastic(body.vertices, body.tets, Material(YOUNG, 0.45))
    found = continuation(
        lambda t: [elastic],
        body.vertices,
        fixed=np.repeat(proximal | distal, 3),
        prescribed=lambda t: scenes.turned(body.vertices, distal, (0, 1, 0), 120.0 * t),
        options=STEPS,
    )
    return found.x, found.record


def joint(refine: int, at_once: bool) -> Outcome:
    body, proximal, distal = joint_scene(refine)
    clamped = np.repeat(proximal | distal, 3)
    elastic = Elastic(body.vertices, body.tets, Material(YOUNG, 0.45))
    stepwise, record = bent_in_steps(refine)
    if not at_once:
        error, answer = scenes.asymmetry(stepwise, body.vertices, ACROSS_Y), "symmetric solution"
        start, x = body.vertices, stepwise
    else:
        start = scenes.turned(body.vertices, distal, (0, 1, 0), 120.0)
        found = solve([elastic], start, fixed=clamped, options=ONE_STEP)
        x, record, error, answer = found.x, found.record, largest(found.x - stepwise), "in steps"
    return Outcome(start, x, record, elastic, body.triangles, ~clamped, [elastic], error, answer)


@case("joint-steps", "tissue around two bones, one turned by 120° in steps")
def joint_steps(refine: int) -> Outcome:
    return joint(refine, at_once=False)


@case("joint-once", "tissue around two bones, one turned by 120° at once")
def joint_once(refine: int) -> Outcome:
    return joint(refine, at_once=True)
