"""Plastic strains that differ much from tet to tet."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ONE_STEP, STEPS, YOUNG, Outcome, case, largest
from benchmarks.fem.scenes import Body
from handpipe.core import BoolArray
from handpipe.fem.elements import Material, plasticity
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import continuation, solve


@case("plastic-compatible", "plastic stretches from 0.05 to 4 of a known shape, at once")
def plastic_compatible(refine: int) -> Outcome:
    body = scenes.box((2.0, 1.0, 1.0), (6 * refine, 3 * refine, 3 * refine))
    x = body.vertices
    target = scenes.grown(body)
    clamped = np.repeat(body.where(0, -1.0), 3)
    elastic = Elastic(x, body.tets, Material(YOUNG, 0.45))
    gradients = elastic.deformation_gradients(target)
    strains = plasticity.from_matrices(scenes.square_roots(gradients.transpose(0, 2, 1) @ gradients))
    elastic = elastic.with_strains(strains)
    start = x.copy()
    start.reshape(-1)[clamped] = target.reshape(-1)[clamped]
    found = solve([elastic], start, fixed=clamped, options=ONE_STEP)
    error = largest(found.x - target)
    return Outcome(
        start, found.x, found.record, elastic, body.triangles, ~clamped, [elastic], error, "the known shape"
    )


def random_scene(refine: int, low: float, high: float) -> tuple[Body, Callable[[float], Elastic], BoolArray]:
    """A box clamped at one end, and its elasticity under a share t of the logarithms of the strains."""
    body = scenes.box((2.0, 1.0, 1.0), (6 * refine, 3 * refine, 3 * refine))
    elastic = Elastic(body.vertices, body.tets, Material(YOUNG, 0.45))
    logarithms = plasticity.log(scenes.random_strains(len(body.tets), low, high))
    clamped = np.repeat(body.where(0, -1.0), 3)
    return body, lambda t: elastic.with_strains(plasticity.exp(t * logarithms)), clamped


def random_strains(refine: int, low: float, high: float, at_once: bool) -> Outcome:
    """The strains fit together nowhere: the body is full of stress at best, and has several equilibria."""
    body, strained, clamped = random_scene(refine, low, high)
    start, elastic = body.vertices, strained(1.0)
    if at_once:
        found = solve([elastic], start, fixed=clamped, options=ONE_STEP)
    else:
        found = continuation(lambda t: [strained(t)], start, fixed=clamped, options=STEPS)
    return Outcome(
        start, found.x, found.record, elastic, body.triangles, ~clamped, [elastic], None, "none known"
    )


def enter_random_strains() -> None:
    for low, high in ((0.3, 2.5), (0.05, 4.0)):
        for name, way, at_once in (("steps", "in steps", False), ("once", "at once", True)):
            case(
                f"plastic-{name}-{low}",
                f"plastic stretches from {low} to {high:g} at random from tet to tet, {way}",
            )(partial(random_strains, low=low, high=high, at_once=at_once))


enter_random_strains()
