"""Plastic strains that differ much from tet to tet."""

from __future__ import annotations

import numpy as np

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ONE_STEP, STEPS, YOUNG, Outcome, case, largest
from handpipe.fem import plasticity
from handpipe.fem.elastic import Elastic
from handpipe.fem.equilibrium import continuation, solve
from handpipe.fem.materials import Material
from handpipe.fem.potential import Potential


@case("plastic-compatible", "plastic stretches from 0.05 to 4 of a known shape, at once")
def plastic_compatible(refine: int) -> Outcome:
    body = scenes.box((2.0, 1.0, 1.0), (6 * refine, 3 * refine, 3 * refine))
    x = body.vertices
    target = scenes.grown(body)
    held = np.repeat(body.where(0, -1.0), 3)
    elastic = Elastic(x, body.tets, Material(YOUNG, 0.45))
    gradients = elastic.deformation_gradients(target)
    strains = plasticity.from_matrices(scenes.square_roots(gradients.transpose(0, 2, 1) @ gradients))
    elastic = elastic.with_strains(strains)
    start = x.copy()
    start.reshape(-1)[held] = target.reshape(-1)[held]
    found = solve([elastic], start, fixed=held, options=ONE_STEP)
    error = largest(found.x - target)
    return Outcome(
        start, found.x, found.record, elastic, body.triangles, ~held, [elastic], error, "the known shape"
    )


def plastic_random(refine: int, at_once: bool) -> Outcome:
    body = scenes.box((2.0, 1.0, 1.0), (6 * refine, 3 * refine, 3 * refine))
    x = body.vertices
    held = np.repeat(body.where(0, -1.0), 3)
    elastic = Elastic(x, body.tets, Material(YOUNG, 0.45))
    logs = plasticity.log(scenes.random_strains(len(body.tets), 0.05, 4.0))

    def strained(t: float) -> list[Potential]:
        return [elastic.with_strains(plasticity.exp(t * logs))]

    if at_once:
        found = solve(strained(1.0), x, fixed=held, options=ONE_STEP)
    else:
        found = continuation(strained, x, fixed=held, options=STEPS)
    final = elastic.with_strains(plasticity.exp(logs))
    return Outcome(x, found.x, found.record, final, body.triangles, ~held, [final], None, "none known")


@case("plastic-random-once", "plastic stretches from 0.05 to 4 at random from tet to tet, at once")
def plastic_random_once(refine: int) -> Outcome:
    return plastic_random(refine, at_once=True)


@case("plastic-random-steps", "the same in steps")
def plastic_random_steps(refine: int) -> Outcome:
    return plastic_random(refine, at_once=False)
