"""The search for the strains of all tets whose equilibrium meets the marks (Wang 2021 §5.4).

Stages: attachments alone, then landmarks, then marks, each first over uniform strains. The marks' weight
grows in steps, so that what many of them say together comes before what each one says alone. Steps are those
of Gauss and Newton with a line search on the true objective, whose equilibria start from the predicted shape.
Unlike Wang 2021, strains are logarithms, and positive definite whatever the step.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from handpipe.arrays import Array
from handpipe.errors import ConvergenceError, InputError
from handpipe.fem import equilibrium, plasticity
from handpipe.fem.constraints import Attachment
from handpipe.fem.elastic import Elastic
from handpipe.fem.materials import Material
from handpipe.fem.potential import Potential
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.shapes.attached import Attached
from handpipe.shapes.correspondence import Correspondence
from handpipe.shapes.fit import MUSCLE
from handpipe.shapes.gauss_newton import RIDGE, GaussNewton, Rows, Step
from handpipe.shapes.response import Response
from handpipe.shapes.rigid_motions import LooseMotions
from handpipe.shapes.smoothness import Smoothness
from handpipe.shapes.strain_frame import StrainFrame

FindMarks = Callable[[Array], Correspondence]

log = logging.getLogger(__name__)

SHORTEST = 0.01  # share of a step below which a stage ends (Wang 2021 §5.4, criterion iii)
LARGEST = 1.0  # change of a log-strain in one step
ARMIJO = 0.1
RESOLUTION = np.array([0.002, 0.01])  # mm of the mean and the largest distance that another step is worth
MET = 1e-8  # of the objective: a mark off by 0.03 micrometres; what is left is rounding
GROWTH = (0.01, 0.1, 1.0)  # of the marks' weight
EARLY = 4  # steps of a stage that another one follows


@dataclass(frozen=True)
class Settings:
    """alpha, beta: 1/mm^2, weights of marks and attachments against smoothness (Wang 2021 Eq. 5.3); spring:
    mN/mm of an attached point; tangential: share of a mark's distance that counts along the surface;
    iterations: at most, at the full weight; enough: mm of the farthest mark at which the search ends;
    progress: relative decrease of the objective below which a stage ends; outliers: give less weight to marks
    far beyond the others, beyond some times mark_error (mm) at least; covering: the marks are all over the
    boundary, and no part of the organ is far from all of them; remesh_below: smallest dihedral angle (deg) of
    a tet below which the organ is meshed anew (0: never).
    """

    alpha: float = 10.0
    beta: float = 10.0
    spring: float = 500.0
    tangential: float = 0.1
    iterations: int = 20
    enough: float = 0.05
    progress: float = 0.01
    outliers: bool = False
    mark_error: float = 0.2
    covering: bool = False
    remesh_below: float = 5.0
    material: Material = field(default=MUSCLE)

    def __post_init__(self) -> None:
        for name, (lower, upper) in RANGES.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and lower <= value <= upper):
                problem = f"is {value}, not between {lower:g} and {upper:g}"
                raise InputError("Settings", name, problem, "Give a number in this range")


# Of each number in `Settings`.
RANGES: dict[str, tuple[float, float]] = {
    "alpha": (1e-6, 1e6),
    "beta": (1e-6, 1e6),
    "spring": (1e-6, 1e9),
    "tangential": (0.0, 1.0),
    "iterations": (0, 10_000),
    "enough": (0.0, 100.0),
    "progress": (0.0, 1.0),
    "mark_error": (1e-6, 100.0),
    "remesh_below": (0.0, 60.0),
}


@dataclass(frozen=True)
class State:
    """Log-strains (m, 6), the body under them, its equilibrium x (n, 3), and the tangled tets of that."""

    logs: Array
    body: Elastic
    x: Array
    tangles: int


@dataclass(frozen=True)
class Record:
    """One step: distances in mm, eigenvalue the least of all plastic strains, inner iterations (0: solved
    directly) of the linear system, number of tets and their smallest dihedral angle in degrees.
    """

    stage: str
    objective: float
    marks_mean: float
    marks_max: float
    attachments_max: float
    eigenvalue: float
    step: float
    rows: int
    inner_iterations: int
    tets: int
    smallest_dihedral: float
    seconds: float


class Search:
    """The objective of Wang 2021 Eq. 5.3 and steps that lower it, on a template mesh.

    loads: further potentials that act on the body, known beforehand; frame: of log-strains, where the mesh at
    rest is not the template.
    """

    def __init__(
        self,
        mesh: TetMesh,
        attached: Attached | None = None,
        loads: Sequence[Potential] = (),
        settings: Settings | None = None,
        frame: StrainFrame | None = None,
    ) -> None:
        self.mesh, self.settings, self.frame = mesh, settings or Settings(), frame
        self.smoothness = Smoothness(mesh.tets)
        self.body = Elastic(mesh.vertices, mesh.tets, self.settings.material)
        self.held: list[Potential] = list(loads)
        nothing = sp.csr_matrix((0, len(mesh.vertices)))
        self.attached = attached or Attached(nothing, np.zeros((0, 3)))
        if attached is not None:
            self.held.append(Attachment(attached.matrix, attached.targets, self.settings.spring))
        self.record: list[Record] = []
        self.hindered = False  # whether tets stood in the way of the last step

    def begin(self, start: Array) -> State:
        """The equilibrium without strains, from a shape (n, 3) near it."""
        return self.at(np.zeros((len(self.mesh.tets), 6)), start)

    def at(self, logs: Array, x: Array) -> State:
        """The equilibrium under log-strains, from x (n, 3); raises `ConvergenceError` where there is none."""
        body = self.strained(logs)
        pins = LooseMotions(self.attached.targets, x).pins(x)
        options = equilibrium.Options(name="organ")
        found = equilibrium.solve([body, *self.held], x, fixed=pins, options=options)
        return State(logs, body, found.x, found.record.tangles)

    def strained(self, logs: Array) -> Elastic:
        """The body under log-strains (m, 6)."""
        since = logs if self.frame is None else self.frame(logs)
        return self.body.with_strains(plasticity.exp(since))

    def run(
        self, state: State, stage: str, find: FindMarks, weight: float, uniform: bool, most: int
    ) -> State:
        """At most that many steps; `find` gives the marks' places on the present shape before each."""
        first, ended = len(self.record), most == 0
        while not ended:
            state, ended = self.advance(state, stage, find, weight, uniform, most, first)
        return state

    def advance(
        self, state: State, stage: str, find: FindMarks, weight: float, uniform: bool, most: int, first: int
    ) -> tuple[State, bool]:
        """One step of a stage whose record begins with number `first`; whether it is the last one."""
        begun = time.perf_counter()
        earlier = [[r.marks_mean, r.marks_max] for r in self.record[first:]]
        marks = weighted(find(state.x), weight)
        before = self.objective(state, marks)
        state, length, step = self.improve(state, marks, uniform, before)
        after = self.objective(state, marks)
        found = self.note(state, stage, find, marks, after, length, step.iterations, begun)
        stuck = length == 0.0 or before - after < self.settings.progress * before
        if stuck or after < MET or len(earlier) + 1 >= most:
            return state, True
        if marks.count == 0:
            return state, False
        distances = np.array([found.marks_mean, found.marks_max])
        nearest = np.min(earlier, axis=0) if earlier else np.full(2, np.inf)
        near = bool(distances[1] < self.settings.enough)
        return state, near or bool((nearest - distances < RESOLUTION).all())

    def objective(self, state: State, marks: Correspondence) -> float:
        """Wang 2021 Eq. 5.3 with halves."""
        mean = state.logs.mean(axis=0)
        prior = self.smoothness.energy(state.logs) + 0.5 * float(RIDGE @ mean**2)
        return prior + 0.5 * float((self.rows(state.x, marks).residuals ** 2).sum())

    def rows(self, x: Array, marks: Correspondence) -> Rows:
        """Weighted residuals of marks and attachments."""
        matrix, residuals = marks.rows(x)
        root = np.sqrt(self.settings.beta)
        held = sp.kron(self.attached.matrix, sp.eye(3), format="csr")
        return Rows(
            sp.vstack([matrix, root * held], format="csr"),
            np.concatenate([residuals, root * self.attached.errors(x).ravel()]),
        )

    def step(self, state: State, marks: Correspondence, uniform: bool) -> tuple[Step, LooseMotions]:
        """The Gauss-Newton step, and the motions that attachments leave free."""
        motions = LooseMotions(self.attached.targets, state.x)
        system = self.system(state, marks, motions)
        return (system.uniform() if uniform else system.solve()), motions

    def system(self, state: State, marks: Correspondence, motions: LooseMotions) -> GaussNewton:
        """The quadratic model of the objective about a state."""
        response = Response(state.body, self.held, state.x, state.logs, motions.modes(state.x), self.frame)
        return GaussNewton(self.smoothness, response, self.rows(state.x, marks), state.logs)

    def improve(
        self, state: State, marks: Correspondence, uniform: bool, before: float
    ) -> tuple[State, float, Step]:
        """The longest of the steps 1, 1/2, 1/4... that lowers the objective, and its length (0: none)."""
        step, motions = self.step(state, marks, uniform)
        self.hindered = False
        deform = step.motion - (motions.modes(state.x) @ step.loose).reshape(-1, 3)
        for length in _lengths(LARGEST / max(float(np.abs(step.strains).max()), LARGEST)):
            moved = motions.transform(length * step.loose)(state.x + length * deform)
            try:
                trial = self.at(state.logs + length * step.strains, moved)
            except ConvergenceError as error:
                log.info("step %.3f: %s", length, error)
                self.hindered = True
                continue
            if trial.tangles > state.tangles:
                log.info("step %.3f: %d tangled tets", length, trial.tangles)
                self.hindered = True
                continue
            trial = replace(trial, x=motions.settled(trial.x, marks))
            if self.objective(trial, marks) <= before + ARMIJO * length * step.slope:
                return trial, length, step
        return state, 0.0, step

    def note(
        self,
        state: State,
        stage: str,
        find: FindMarks,
        marks: Correspondence,
        objective: float,
        length: float,
        inner_iterations: int,
        begun: float,
    ) -> Record:
        """Put a step, or what stands for one, into the record."""
        distances = np.linalg.norm(find(state.x).errors(state.x), axis=1)
        held = np.linalg.norm(self.attached.errors(state.x), axis=1)
        found = Record(
            stage=stage,
            objective=objective,
            marks_mean=float(distances.mean()) if len(distances) else 0.0,
            marks_max=float(distances.max(initial=0.0)),
            attachments_max=float(held.max(initial=0.0)),
            eigenvalue=float(plasticity.eigenvalues(state.body.strains).min()),
            step=length,
            rows=3 * (marks.count + len(held)),
            inner_iterations=inner_iterations,
            tets=len(state.logs),
            smallest_dihedral=self.mesh.moved(state.x).smallest_dihedral(),
            seconds=time.perf_counter() - begun,
        )
        self.record.append(found)
        log.info(
            "%s: objective %.4g, marks %.3f (%.3f), attachments %.3f mm, eigenvalue %.2f, step %.2f, %.1f s",
            *(stage, objective, found.marks_mean, found.marks_max, found.attachments_max),
            *(found.eigenvalue, length, found.seconds),
        )
        return found


def weighted(marks: Correspondence, weight: float) -> Correspondence:
    """The same marks with their squared errors multiplied by a weight."""
    metrics = np.tile(np.eye(3), (marks.count, 1, 1)) if marks.metrics is None else marks.metrics
    return replace(marks, metrics=np.sqrt(weight) * metrics)


def _lengths(length: float) -> Iterator[float]:
    shortest = SHORTEST * length
    while length >= shortest:
        yield length
        length *= 0.5
