"""Slivers, and neighbours of very different stiffness."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ONE_STEP, STEPS, YOUNG, Outcome, case, largest
from benchmarks.fem.scenes import Body
from handpipe.core import Array, BoolArray
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import continuation, solve
from handpipe.fem.solver.equilibrium import Record


@case("slivers-stretch", "smallest dihedral < 1°, stretched to 1.5 times at once")
def slivers_stretch(refine: int) -> Outcome:
    body = scenes.with_slivers(scenes.box((3.0, 1.0, 1.0), (9 * refine, 4 * refine, 4 * refine)), 0.005, 0.3)
    material = Material(YOUNG, 0.45)
    x = body.vertices
    lateral = scenes.lateral_stretch(material, 1.5)
    ends = body.where(0, -1.5) | body.where(0, 1.5)
    fixed = np.zeros(x.shape, dtype=bool)
    fixed[ends] = True
    start = x.copy()
    start[ends] = x[ends] * [1.5, lateral, lateral]
    elastic = Elastic(x, body.tets, material)
    found = solve([elastic], start, fixed=fixed, options=ONE_STEP)
    error = largest(found.x - x * [1.5, lateral, lateral])
    free = ~fixed.ravel()
    return Outcome(
        start, found.x, found.record, elastic, body.triangles, free, [elastic], error, "uniform stretch"
    )


def turned_end(body: Body, young: Array) -> Outcome:
    """One end is turned by 90 degrees at once; nothing else holds the body, which has to follow rigidly."""
    x = body.vertices
    clamped = body.where(0, float(x[:, 0].min()))
    start = scenes.turned(x, clamped, (0, 1, 0), 90.0)
    elastic = Elastic(x, body.tets, Material(young, 0.45))
    found = solve([elastic], start, fixed=np.repeat(clamped, 3), options=ONE_STEP)
    error = largest(found.x - x @ scenes.rotation((0, 1, 0), 90.0).T)
    free = ~np.repeat(clamped, 3)
    return Outcome(
        start, found.x, found.record, elastic, body.triangles, free, [elastic], error, "rigid motion"
    )


@case("stiffness-random", "stiffness 1 or 10⁶ from tet to tet at random, one end turned by 90° at once")
def stiffness_random(refine: int) -> Outcome:
    body = scenes.box((3.0, 1.0, 1.0), (9 * refine, 3 * refine, 3 * refine))
    return turned_end(body, np.random.default_rng(0).choice([1.0, 1e6], len(body.tets)))


@case("stiffness-slivers", "the same with slivers")
def stiffness_slivers(refine: int) -> Outcome:
    body = scenes.with_slivers(scenes.box((3.0, 1.0, 1.0), (9 * refine, 4 * refine, 4 * refine)), 0.005, 0.3)
    return turned_end(body, np.random.default_rng(0).choice([1.0, 1e6], len(body.tets)))


@case("stiffness-halves", "one half 10⁶ times stiffer, its end turned by 60° in steps")
def stiffness_halves(refine: int) -> Outcome:
    body = scenes.box((3.0, 1.0, 1.0), (12 * refine, 3 * refine, 3 * refine))
    x = body.vertices
    stiff = x[body.tets, 0].mean(axis=1) > 0

    def bent(part: BoolArray) -> Callable[[float], Array]:
        return lambda t: scenes.turned(x, part, (0, 1, 0), 60.0 * t)

    def bend(elastic: Elastic, driven: BoolArray) -> tuple[Array, Record, BoolArray]:
        clamped = np.repeat(driven | body.where(0, -1.5), 3)
        found = continuation(lambda t: [elastic], x, fixed=clamped, prescribed=bent(driven), options=STEPS)
        return found.x, found.record, ~clamped

    rigid = bend(Elastic(x, body.tets, Material(YOUNG, 0.45)), x[:, 0] > -1e-9)[0]
    elastic = Elastic(x, body.tets, Material(np.where(stiff, 1e6, 1.0) * YOUNG, 0.45))
    shape, record, free = bend(elastic, body.where(0, 1.5))
    answer = "the stiff half rigid"
    return Outcome(x, shape, record, elastic, body.triangles, free, [elastic], largest(shape - rigid), answer)
