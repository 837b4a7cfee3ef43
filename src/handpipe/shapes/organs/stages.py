"""The stages of a fit, one after the other: attachments, landmarks, marks, the image (Wang 2021 §5.4)."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import HandpipeError
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.straight import in_space
from handpipe.shapes.optimisation.strain_space import Stage, State
from handpipe.shapes.organs.remeshing import EARLY, Given, OnMesh, remeshed, worn

log = logging.getLogger(__name__)

NEW_TETS = "new tets"  # a row of the record
MESHINGS = 12  # at most, in one fit
GROWTH = (0.01, 0.1, 1.0)  # of the marks' weight
UNIFORM = 1  # strain field


@dataclass(frozen=True)
class Planned:
    """A stage with attachments and "nothing" else, "landmarks", "marks" or the "image", on any mesh."""

    name: str
    uses: str
    weight: float
    fields: int | None
    most: int

    def on(self, task: OnMesh) -> Stage:
        """The stage on the current mesh."""
        return Stage(self.name, task.find(self.uses), self.weight, self.fields, self.most)


@dataclass(frozen=True)
class FitPosition:
    """Position of a fit: the stage, whose record begins with number `first`, and the meshes made so far."""

    task: OnMesh
    state: State
    stage: int = 0
    first: int = 0
    meshings: int = 0


def plan(given: Given) -> list[Planned]:
    """Stages of a fit: attachments, landmarks, marks, the image, as far as given.

    Each is used over uniform strains first, then with growing weights. Pairs in a plane do not determine
    uniform strains across it: they wait for further observations.
    """
    settings = given.settings
    stages: list[Planned] = []
    more = len(given.marks) > 0 or given.image is not None
    attached = np.zeros((0, 3)) if given.attached is None else given.attached.targets
    known = np.zeros((0, 3)) if given.known is None else given.known.targets
    if len(attached) and (in_space(attached) or not (more or len(known))):
        stages.append(Planned("attachments", "nothing", 1.0, UNIFORM, EARLY))
    if len(known) and (in_space(np.concatenate([attached, known])) or not more):
        stages += _growing("landmarks", settings.alpha, EARLY, EARLY)
    if len(given.marks):
        stages += _growing("marks", settings.alpha, settings.iterations, settings.iterations)
    if given.image is not None:
        stages += _growing("image", settings.alpha, EARLY, settings.iterations)
    return [stage for stage in stages if stage.most > 0]


def _growing(uses: str, alpha: float, uniform: int, most: int) -> list[Planned]:
    first = Planned(f"{uses}, uniform", uses, alpha, UNIFORM, uniform)
    steps = [most if share == 1.0 else EARLY for share in GROWTH]
    return [first, *(Planned(uses, uses, g * alpha, None, n) for g, n in zip(GROWTH, steps, strict=True))]


def follow(
    position: FitPosition, stages: Sequence[Planned], save: Callable[[FitPosition], None]
) -> FitPosition:
    """All steps that are left; `save` gets every position."""
    while position.stage < len(stages):
        position = _advanced(position, stages[position.stage])
        save(position)
    return position


def _advanced(at: FitPosition, stage: Planned) -> FitPosition:
    """One step, then new tets if it degraded them: with new tets the stage begins again."""
    search = at.task.search
    state, ended = search.advance(at.state, stage.on(at.task), at.first)
    at = replace(at, state=state)
    if at.meshings < MESHINGS and _settled(stage, ended) and worn(at.task, state):
        at, begun = replace(at, meshings=at.meshings + 1), time.perf_counter()
        try:
            task, state = remeshed(at.task, state)
        except HandpipeError as error:
            log.warning("the organ keeps its tets: %s", error)
        else:
            nothing = Correspondence.none(len(state.x))
            before = task.search.objective(state, nothing, stage.weight)
            task.search.note(state, NEW_TETS, task.find(stage.uses)(state.x), (before, 0.0, begun))
            at = replace(at, task=task, state=state, first=len(search.record))
            ended = stage.fields == UNIFORM
    return replace(at, stage=at.stage + 1, first=len(search.record)) if ended else at


def _settled(stage: Planned, ended: bool) -> bool:
    """Whether a shape is worth new tets.

    Uniform strains may be far off before they converge, and attachments alone hardly determine them.
    """
    return stage.fields != UNIFORM or (ended and stage.uses != "nothing")
