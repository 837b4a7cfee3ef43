"""A beam whose one end is turned by 180 degrees."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ONE_STEP, STEPS, SWAP_YZ, YOUNG, Outcome, case, largest
from benchmarks.fem.scenes import Body
from handpipe.core import Array, BoolArray
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Steps, continuation, solve
from handpipe.fem.solver.equilibrium import Record


def twist_scene(refine: int, poisson: float) -> tuple[Body, Elastic, BoolArray, Callable[[float], Array]]:
    body = scenes.box((4.0, 1.0, 1.0), (12 * refine, 3 * refine, 3 * refine))
    right = body.where(0, 2.0)

    def ends(t: float) -> Array:
        return scenes.turned(body.vertices, right, (1, 0, 0), 180.0 * t)

    elastic = Elastic(body.vertices, body.tets, Material(YOUNG, poisson))
    return body, elastic, np.repeat(right | body.where(0, -2.0), 3), ends


@lru_cache(maxsize=8)
def twisted_in_steps(refine: int, poisson: float) -> tuple[Array, Record]:
    body, elastic, clamped, ends = twist_scene(refine, poisson)
    found = continuation(
        lambda t: [elastic],
        body.vertices,
        fixed=clamped,
        prescribed=ends,
        options=STEPS,
        steps=Steps(first=1 / 12),
    )
    return found.x, found.record


def twist_in_steps(refine: int, poisson: float) -> Outcome:
    body, elastic, clamped, ends = twist_scene(refine, poisson)
    x, record = twisted_in_steps(refine, poisson)
    # Seen from a frame that turns with the middle, half a turn about the line y = -z changes nothing.
    halfway = x @ scenes.rotation((1, 0, 0), -90.0).T
    error = scenes.asymmetry(halfway, body.vertices, np.array([[-1.0, 0, 0], [0, 0, -1.0], [0, -1.0, 0]]))
    return Outcome(
        body.vertices, x, record, elastic, body.triangles, ~clamped, [elastic], error, "symmetric solution"
    )


def twist_at_once(refine: int, poisson: float) -> Outcome:
    body, elastic, clamped, ends = twist_scene(refine, poisson)
    found = solve([elastic], ends(1.0), fixed=clamped, options=ONE_STEP)
    # Half a turn has no sense: the right-handed twist and its mirror image are equally good.
    right_handed = twisted_in_steps(refine, poisson)[0]
    left_handed = right_handed[scenes.mirror_images(body.vertices, SWAP_YZ)] @ SWAP_YZ
    error = min(largest(found.x - right_handed), largest(found.x - left_handed))
    answer = "in steps, or its mirror image"
    return Outcome(
        ends(1.0), found.x, found.record, elastic, body.triangles, ~clamped, [elastic], error, answer
    )


def enter_twists() -> None:
    for poisson in (0.3, 0.45, 0.49, 0.499):
        case(f"twist-steps-{poisson}", f"beam, one end turned by 180° in steps, ν = {poisson}")(
            partial(twist_in_steps, poisson=poisson)
        )
        case(f"twist-once-{poisson}", f"beam, one end turned by 180° at once, ν = {poisson}")(
            partial(twist_at_once, poisson=poisson)
        )


enter_twists()
