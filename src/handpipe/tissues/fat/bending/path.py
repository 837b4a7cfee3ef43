"""The way of a tissue from a pose in which its skin does not cross itself to another pose."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, ConvergenceError, RigidTransform, Shapes, SimulatedFrame
from handpipe.fem.contact import Barrier
from handpipe.fem.solver import Settled
from handpipe.tissues.fat.bending.bodies import Bodies
from handpipe.tissues.fat.bending.bones import partway, turn
from handpipe.tissues.fat.resting import OPTIONS, LoadCase, behind
from handpipe.tissues.fat.tissue import Tissue

log = logging.getLogger(__name__)

SMALLEST = 1 / 8  # of a step, below which the way ends
BRIEF = replace(OPTIONS, displacement_tolerance=0.1, force_tolerance=0.3, saddles=True)  # on the way


@dataclass(frozen=True)
class Pace:
    """How a tissue goes its way.

    Parameters
    ----------
    step : float
        Angle in rad by which the joint that turns most turns in a step, at most.
    iterations : int
        Newton's iterations of a step on the way, at most: its shape has to be near an equilibrium alone.
    """

    step: float
    iterations: int


class _Hasty:
    """Tells a solve that it may end after so many iterations."""

    def __init__(self, iterations: int) -> None:
        self._left = iterations

    def __call__(self, x: Array, step: Array) -> bool:
        self._left -= 1
        return self._left <= 0


CaseAt = Callable[[Mapping[str, RigidTransform], Mapping[str, Shapes]], LoadCase]


@dataclass(frozen=True)
class Origin:
    """Where a way begins.

    Parameters
    ----------
    x : array (n, 3)
        Vertices of the tissue in mm, at which its skin does not cross itself.
    bones : mapping of str to RigidTransform
        Transforms of the bones there.
    bodies : mapping of str to Shapes
        Shapes by layer there.
    name : str
        The pose's name.
    """

    x: Array
    bones: Mapping[str, RigidTransform]
    bodies: Mapping[str, Shapes]
    name: str

    @staticmethod
    def neutral(tissue: Tissue, below: Mapping[str, Shapes]) -> Origin:
        """Neutral, where all bodies are at rest."""
        still = dict.fromkeys(tissue.bones, RigidTransform.identity())
        rest = {
            layer: {name: replace(shape, vertices=shape.rest) for name, shape in shapes.items()}
            for layer, shapes in below.items()
        }
        return Origin(tissue.mesh.vertices, still, rest, "neutral")

    @staticmethod
    def of(frame: SimulatedFrame, layer: str) -> Origin:
        """Another frame, by its shapes and the name of the tissue's layer."""
        pose, shapes = frame
        return Origin(shapes[layer][f"{layer}_mesh"].vertices, pose.bones, shapes, pose.name)


def bent(
    case_at: CaseAt, last: LoadCase, bones: Mapping[str, RigidTransform], origin: Origin, pace: Pace
) -> Settled:
    """The equilibrium of a tissue in a pose, by smaller bends from where its skin does not cross itself.

    In each step the tissue is carried by the bones as far as its skin stays out of itself, and comes nearer
    to equilibrium behind the skin's barrier: sheets of skin meet and never pass through one another.

    Parameters
    ----------
    case_at : callable
        The tissue in a pose, from the bones' transforms and the shapes by layer.
    last : LoadCase
        The tissue in the last pose.
    bones : mapping of str to RigidTransform
        Transforms of the bones in the last pose.
    origin : Origin
        Where the way begins.
    pace : Pace
        Lengths of the steps, and iterations in each.

    Returns
    -------
    Settled
        The equilibrium, its contact renewed.

    Raises
    ------
    ConvergenceError
        Where a step fails, however small.

    """
    tissue, parents = last.tissue, last.tissue.parents
    barrier = tissue.skin_barrier()
    if barrier is None:
        raise ConvergenceError(
            "the way", "the neutral skin intersects itself: no barrier keeps it out of itself"
        )
    bodies = Bodies(tissue, origin.bones, bones, origin.bodies, last.below)
    most = max((turn(origin.bones, bones, child, of) for child, of in parents.items()), default=0.0)
    first = 1.0 / max(1, int(np.ceil(most / pace.step)))
    log.info("soft tissue: bent from %s in %.0f steps", origin.name, 1.0 / first)
    x, before, done, size = origin.x, origin.bones, 0.0, first
    while done < 1.0:
        share = min(1.0, done + size)
        there = partway(origin.bones, bones, parents, share)
        case = last if share == 1.0 else case_at(there, bodies.at(there, share))
        start = carried(tissue, barrier, x, before, there)
        try:
            hasty = replace(BRIEF, enough=_Hasty(pace.iterations))
            x = case.equilibrium([barrier], start, start, hasty).x
        except ConvergenceError as error:
            size *= 0.5
            if size < SMALLEST * first:
                raise error.within(f"{share:.2f} of the way from {origin.name}") from error
            log.info("soft tissue: %s; halving the step", error)
            continue
        done, before = share, there
    return behind(last, barrier, x)


def carried(
    tissue: Tissue,
    barrier: Barrier,
    x: Array,
    before: Mapping[str, RigidTransform],
    bones: Mapping[str, RigidTransform],
) -> Array:
    """Positions x (n, 3) moved on with the bones as far as the skin stays out of itself."""
    step = tissue.carried(x, before, bones) - x
    moved: Array = x + barrier.max_step(x, step) * step
    return moved
