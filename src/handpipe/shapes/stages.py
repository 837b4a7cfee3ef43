"""The stages of a fit, one after the other: attachments, landmarks, marks, the image (Wang 2021 §5.4)."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handpipe.errors import HandpipeError
from handpipe.shapes.correspondence import Correspondence
from handpipe.shapes.remeshing import Given, OnMesh, remeshed, worn
from handpipe.shapes.search import EARLY, GROWTH, State
from handpipe.shapes.straight import in_space

log = logging.getLogger(__name__)

NEW_TETS = "new tets"  # a row of the record
MESHINGS = 12  # at most, in one fit


@dataclass(frozen=True)
class Stage:
    """At most that many steps towards what it uses ("nothing" but attachments, "landmarks", "marks",
    "image"), over uniform strains or those of all tets.
    """

    name: str
    uses: str
    weight: float
    uniform: bool
    most: int


@dataclass(frozen=True)
class Position:
    """Where a fit is: in which stage, whose record begins with number `first`, after how many new meshes."""

    task: OnMesh
    state: State
    stage: int = 0
    first: int = 0
    meshings: int = 0


def plan(given: Given) -> list[Stage]:
    """Attachments, landmarks, marks, the image, as far as given: each over uniform strains first, then
    with growing weights. Pairs in a plane would let uniform strains across it go astray: they wait for more.
    """
    settings = given.settings
    stages: list[Stage] = []
    more = len(given.marks) > 0 or given.image is not None
    held = np.zeros((0, 3)) if given.held is None else given.held.targets
    known = np.zeros((0, 3)) if given.known is None else given.known.targets
    if len(held) and (in_space(held) or not (more or len(known))):
        stages.append(Stage("attachments", "nothing", 1.0, True, EARLY))
    if len(known) and (in_space(np.concatenate([held, known])) or not more):
        stages += _growing("landmarks", settings.alpha, EARLY, EARLY)
    if len(given.marks):
        stages += _growing("marks", settings.alpha, settings.iterations, settings.iterations)
    if given.image is not None:
        stages += _growing("image", settings.alpha, EARLY, settings.iterations)
    return [stage for stage in stages if stage.most > 0]


def _growing(uses: str, alpha: float, uniform: int, most: int) -> list[Stage]:
    first = Stage(f"{uses}, uniform", uses, alpha, True, uniform)
    steps = [most if share == 1.0 else EARLY for share in GROWTH]
    return [first, *(Stage(uses, uses, g * alpha, False, n) for g, n in zip(GROWTH, steps, strict=True))]


def follow(position: Position, stages: Sequence[Stage], save: Callable[[Position], None]) -> Position:
    """All steps that are left; `save` gets every position."""
    while position.stage < len(stages):
        position = _advanced(position, stages[position.stage])
        save(position)
    return position


def _advanced(at: Position, stage: Stage) -> Position:
    """One step, then new tets if it ruined them: with these the stage begins anew."""
    search, find = at.task.search, at.task.find(stage.uses)
    state, ended = search.advance(
        at.state, stage.name, find, stage.weight, stage.uniform, stage.most, at.first
    )
    at = replace(at, state=state)
    if at.meshings < MESHINGS and _settled(stage, ended) and worn(at.task, state):
        at, begun = replace(at, meshings=at.meshings + 1), time.perf_counter()
        try:
            task, state = remeshed(at.task, state)
        except HandpipeError as error:
            log.warning("the organ keeps its tets: %s", error)
        else:
            nothing = Correspondence.none(len(state.x))
            before = task.search.objective(state, nothing)
            task.search.note(state, NEW_TETS, task.find(stage.uses), nothing, before, 0.0, 0, begun)
            at = replace(at, task=task, state=state, first=len(search.record))
            ended = stage.uniform
    return replace(at, stage=at.stage + 1, first=len(search.record)) if ended else at


def _settled(stage: Stage, ended: bool) -> bool:
    """Whether a shape is worth new tets: uniform strains may go far astray before they come to rest, and
    attachments alone hardly tell them.
    """
    return not stage.uniform or (ended and stage.uses != "nothing")
