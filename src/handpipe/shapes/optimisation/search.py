"""The search for plastic strains whose equilibrium meets marks (Wang 2021 §5.4), over any strain space.

Minimises, over the unknowns S of the space,

    (prior(S) + weight sum_k |A_k x - z_k|^2 + beta |attachment errors|^2 + loose |moves of loose ends|^2) / 2

where x is the equilibrium of the body with the plastic strains of S under springs and loads. Strains are
logarithms, so that plastic strains stay positive definite without Wang 2021's clamping. Steps are those of
Gauss and Newton with a line search on the true objective, whose equilibria start from the predicted shape.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, ConvergenceError
from handpipe.fem.contact import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Elastic, Potential
from handpipe.fem.solver import equilibrium
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.rigid_motions import LooseMotions
from handpipe.shapes.optimisation.settings import SearchSettings
from handpipe.shapes.optimisation.strain_space import Stage, State, Step, StrainSpace

log = logging.getLogger(__name__)

SHORTEST = 0.01  # share of a step below which a stage ends (Wang 2021 §5.4, criterion iii)
LARGEST = 1.0  # change of a log-strain in one step
ARMIJO = 0.1  # share of the predicted decrease of the objective that a step must bring
MET = 1e-8  # of the objective: a mark off by 0.03 micrometres; below is rounding


@dataclass(frozen=True)
class StepRecord:
    """One step: errors in mm, eigenvalue the least of all plastic strains."""

    stage: str
    objective: float
    marker_mean: float
    marker_max: float
    attachment_max: float
    eigenvalue: float
    step: float
    seconds: float


class Search:
    """The objective on a mesh at rest, and steps that lower it.

    loads: further potentials that act on the body. record: every step; hindered: whether tets shortened the
    last step; near: whether it brought all marks within `enough`.
    """

    def __init__(
        self,
        mesh: TetMesh,
        space: StrainSpace,
        settings: SearchSettings,
        loads: Sequence[Potential] = (),
        name: str = "organ",
    ) -> None:
        self.mesh, self.space, self.settings, self.loads = mesh, space, settings, tuple(loads)
        self.body = Elastic(mesh.vertices, mesh.tets, settings.material)
        self.options = equilibrium.Options(name=name)
        self.record: list[StepRecord] = []
        self.hindered = self.near = False

    def begin(self, attachments: AttachmentTargets, start: Array) -> State:
        """The equilibrium without strains, from a shape (n, 3) near it."""
        return self.at(self.space.zero(), attachments, start)

    def at(self, unknowns: Array, attachments: AttachmentTargets, x: Array) -> State:
        """The equilibrium under strains, from x (n, 3); raises `ConvergenceError` where there is none."""
        body = self.strained(unknowns)
        pins = LooseMotions(attachments.targets, x).pins(x)
        found = equilibrium.solve([body, *self.external(attachments)], x, fixed=pins, options=self.options)
        return State(unknowns, attachments, body, found.x, found.record.tangles)

    def strained(self, unknowns: Array) -> Elastic:
        """The body under strains."""
        return self.body.with_strains(self.space.plastic(unknowns))

    def external(self, attachments: AttachmentTargets) -> list[Potential]:
        """Potentials that act on the body besides its own elasticity."""
        if len(attachments.targets) == 0:
            return [*self.loads]
        return [*self.loads, Attachment(attachments.matrix, attachments.targets, self.settings.spring)]

    def objective(self, state: State, marks: Correspondence, weight: float) -> float:
        """The objective: Wang 2021 Eq. 5.3 times a half."""
        fit = weight * marks.energy(state.x)
        hold = self.settings.beta * float((state.attachments.errors(state.x) ** 2).sum())
        hold += self.settings.loose * float((state.attachments.departures() ** 2).sum())
        return 0.5 * (self.space.prior(state.unknowns) + fit + hold)

    def run(self, state: State, stage: Stage) -> State:
        """All steps of a stage."""
        first, ended = len(self.record), stage.most == 0
        while not ended:
            state, ended = self.advance(state, stage, first)
        return state

    def advance(self, state: State, stage: Stage, first: int) -> tuple[State, bool]:
        """One step of a stage whose record begins with number `first`; whether it is the last one."""
        begun = time.perf_counter()
        marks = stage.find(state.x)
        before = self.objective(state, marks, stage.weight)
        state, length = self.improve(state, marks, stage, before)
        after = self.objective(state, marks, stage.weight)
        self.note(state, stage.name, marks, (after, length, begun))
        stuck = length == 0.0 or before - after < self.settings.progress * before
        errors = np.array([[r.marker_mean, r.marker_max] for r in self.record[first:]])
        self.near = not stuck and marks.count > 0 and bool(errors[-1, 1] < self.settings.enough)
        ended = stuck or self.near or after < MET or len(errors) >= stage.most
        return state, ended or (marks.count > 0 and self._idle(errors))

    def _idle(self, errors: Array) -> bool:
        """Whether the last of errors (s, 2), mean and largest, is no better than the best before it."""
        if self.settings.resolution is None or len(errors) < 2:
            return False
        gain: Array = errors[:-1].min(axis=0) - errors[-1]
        return bool((gain < self.settings.resolution).all())

    def improve(
        self, state: State, marks: Correspondence, stage: Stage, before: float
    ) -> tuple[State, float]:
        """The longest of the steps 1, 1/2, 1/4... that lowers the objective, and its length (0: none)."""
        step = self.space.step(state, self.external(state.attachments), marks, stage)
        motions = LooseMotions(state.attachments.targets, state.x)
        largest = float(np.abs(self.space.logs(step.strains)).max())
        self.hindered = False
        for length in _lengths(LARGEST / max(largest, LARGEST)):
            try:
                trial = self.taken(state, step, length, motions)
            except ConvergenceError as error:
                log.info("step %.3f: %s", length, error)
                self.hindered = True
                continue
            if trial.tangles > state.tangles:
                log.info("step %.3f: %d tangled tets", length, trial.tangles)
                self.hindered = True
                continue
            trial = replace(trial, x=motions.settled(trial.x, marks))
            if self.objective(trial, marks, stage.weight) <= before + ARMIJO * length * step.slope:
                return trial, length
        return state, 0.0

    def taken(self, state: State, step: Step, length: float, motions: LooseMotions) -> State:
        """The equilibrium after a share of a step; motions: those that attachments leave free."""
        predicted = state.x + length * step.motion
        if motions.count:
            deform = step.motion - (motions.modes(state.x) @ step.loose).reshape(-1, 3)
            predicted = motions.transform(length * step.loose)(state.x + length * deform)
        attachments = state.attachments.moved(length * step.ends)
        return self.at(state.unknowns + length * step.strains, attachments, predicted)

    def note(self, state: State, stage: str, marks: Correspondence, step: tuple[float, float, float]) -> None:
        """Record a step, or a remeshing as one; step: objective, length and when it began."""
        objective, length, begun = step
        errors = marks.distances(state.x)
        offsets = np.linalg.norm(state.attachments.errors(state.x), axis=1)
        found = StepRecord(
            stage=stage,
            objective=objective,
            marker_mean=float(errors.mean()) if len(errors) else 0.0,
            marker_max=float(errors.max(initial=0.0)),
            attachment_max=float(offsets.max(initial=0.0)),
            eigenvalue=float(plasticity.eigenvalues(state.body.strains).min()),
            step=length,
            seconds=time.perf_counter() - begun,
        )
        self.record.append(found)
        log.info(
            "%s: objective %.4g, marks %.3f (%.3f), attachments %.3f mm, eigenvalue %.2f, step %.2f, %.1f s",
            *(stage, objective, found.marker_mean, found.marker_max, found.attachment_max),
            *(found.eigenvalue, length, found.seconds),
        )


def _lengths(length: float) -> Iterator[float]:
    shortest = SHORTEST * length
    while length >= shortest:
        yield length
        length *= 0.5
