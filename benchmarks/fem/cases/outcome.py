"""What a hard case is, and what it hands over to be judged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from handpipe.core import Array, BoolArray, IntArray, RigidTransform
from handpipe.fem.potentials import Elastic, Potential
from handpipe.fem.solver import Options
from handpipe.fem.solver.equilibrium import Record

YOUNG = 6.0  # kPa, muscle's
ONE_STEP = Options(max_iterations=400, allow_partial=True)
STEPS = Options(allow_partial=True)
ACROSS_Y = np.diag([1.0, -1.0, 1.0])
SWAP_YZ = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


@dataclass
class Outcome:
    """What a case hands over to be judged: the scene, the end, the solver's word and the known answer.

    start, x (n, 3) in mm; free (3n,) the unknowns; triangles (k, 3) the surface that must not meet itself;
    error in mm against what `answer` names, which may be up to `tolerance`; None where none is known.
    """

    start: Array
    x: Array
    record: Record
    elastic: Elastic
    triangles: IntArray
    free: BoolArray
    potentials: Sequence[Potential]
    error: float | None
    answer: str
    tolerance: float = 1e-3


@dataclass(frozen=True)
class Case:
    """A named scene; `run(refine)` builds it with edges 1/refine as long and solves it."""

    name: str
    what: str
    run: Callable[[int], Outcome] = field(repr=False)


CASES: dict[str, Case] = {}


def case(name: str, what: str) -> Callable[[Callable[[int], Outcome]], Callable[[int], Outcome]]:
    """Enter a function in the list."""

    def enter(run: Callable[[int], Outcome]) -> Callable[[int], Outcome]:
        CASES[name] = Case(name, what, run)
        return run

    return enter


def largest(difference: Array) -> float:
    """Largest distance in mm."""
    return float(np.linalg.norm(difference, axis=1).max())


def without_rigid_motion(x: Array, target: Array) -> float:
    """Largest distance in mm from a target after the best rigid motion."""
    return largest(RigidTransform.fit(x, target)(x) - target)
