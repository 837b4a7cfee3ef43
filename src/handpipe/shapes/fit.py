"""Shape from plastic strains: the strain field whose static equilibrium meets what the image shows (Wang 2021
chapter 5).

Minimises (|L S|^2 + volume |tr S|^2 + strain |S - S_guess|^2) / 2 + alpha / 2 sum_k w_k |A_k x - z_k|^2 +
beta / 2 |attachment errors|^2 over log-strains S, where x is the equilibrium of the elastic body with the
plastic strains exp(S) under its attachment springs. Logarithms keep every plastic strain positive definite,
so that no step needs clamping. The search is coarse to fine: uniform strain first, then more of the smoothest
strain fields; each Gauss-Newton step costs one factorisation of the stiffness matrix.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from handpipe import artifacts
from handpipe.arrays import Array
from handpipe.errors import ConvergenceError
from handpipe.fem import equilibrium, plasticity
from handpipe.fem.constraints import Attachment
from handpipe.fem.elastic import Elastic
from handpipe.fem.linear import SingularMatrix, factorise
from handpipe.fem.materials import Material
from handpipe.mesh.surface import Surface
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.shapes.attached import Attached
from handpipe.shapes.correspondence import Correspondence, Markers
from handpipe.shapes.holds import Holds
from handpipe.shapes.smooth_strains import SmoothStrains
from handpipe.shapes.stretch import COUNTS, StretchField

FindMarkers = Callable[[Surface], Markers]

log = logging.getLogger(__name__)

MUSCLE = Material(6.0, 0.48)  # kPa (Zheng 2022 Table 2)
SMOOTHEST = 30  # strain fields of a guess that are taken over
GUESSED = 0.4  # largest log-strain that is taken over from a guess: a blend of bone motions crushes some tets


@dataclass(frozen=True)
class ShapeOptions:
    """alpha, beta: 1/mm^2, weights of markers and attachments against smoothness (Wang 2021 Eq. 5.3: 1e9 and
    1e8 per m^2); spring: mN/mm of an attached point; fields: how many strain fields each stage may use;
    iterations: at most, in each stage; enough: mm of largest marker error that ends the search; progress:
    relative decrease of the objective below which a stage ends; tangential: share of a marker's error that
    counts along the surface; volume: weight of each tet's squared change of volume (log), strain: of its
    squared departure from the guess's strains, for a body and a guess that are known well; loose: 1/mm^2,
    weight that keeps loose ends where the guess has them.
    """

    alpha: float = 0.1
    beta: float = 0.1
    spring: float = 500.0
    fields: tuple[int, ...] = (1, 12, 60)
    iterations: int = 6
    enough: float = 0.05
    progress: float = 0.01
    tangential: float = 0.05
    volume: float = 0.0
    strain: float = 0.0
    loose: float = 1e-3
    material: Material = MUSCLE


@dataclass(frozen=True)
class Iteration:
    """One Gauss-Newton step: errors in mm, eigenvalue the least of all plastic strains."""

    stage: str
    objective: float
    marker_mean: float
    marker_max: float
    attachment_max: float
    eigenvalue: float
    step: float
    seconds: float


@dataclass
class ShapeFit:
    """Fitted tet vertices (n, 3), plastic strains (m, 6) whose equilibrium they are, and every iteration."""

    vertices: Array
    strains: Array
    record: list[Iteration] = field(default_factory=list)

    def table(self) -> dict[str, list[float] | list[str]]:
        """The record by columns, for an artifact."""
        return artifacts.columns(self.record)


def fit_shape(
    mesh: TetMesh,
    surface: Surface,
    embedding: sparse.csr_matrix,
    attached: Attached,
    find_markers: FindMarkers,
    *,
    loose: Sequence[sparse.csr_matrix] = (),
    landmarks: Attached | None = None,
    start: Array | None = None,
    options: ShapeOptions | None = None,
) -> ShapeFit:
    """Fit a body to markers on its boundary.

    mesh: the body at rest; surface: its embedded surface at rest, carried by embedding (v, n); find_markers
    gives the image's boundary points near the present surface and is called before every step; landmarks:
    known places of points of the body, used before the markers and with them; start: vertices (n, 3) of a
    first guess, whose strains the search begins with; loose: matrices (t_i, n) of points of ends that are
    held somewhere, each as a rigid body whose place is sought from the guess's on. Raises `ConvergenceError`
    where no equilibrium is found at the start.
    """
    options = options or ShapeOptions()
    x = mesh.vertices if start is None else start
    problem = _Problem(mesh, options)
    state = problem.begin(mesh, x, Holds.of(attached, loose, x))
    record: list[Iteration] = []
    nothing = Correspondence.none(len(mesh.vertices))
    known = nothing if landmarks is None else Correspondence(landmarks.matrix, landmarks.targets, None)
    state = problem.run(state, "attachments", options.fields[:1], lambda s: nothing, record)
    if landmarks is not None:
        state = problem.run(state, "landmarks", options.fields[:2], lambda s: known, record)

    def closest(state: _State) -> Correspondence:
        present = surface.moved(embedding @ state.x)
        found = Correspondence.of(find_markers(present), present, embedding, options.tangential)
        return found if landmarks is None else found.with_landmarks(landmarks.matrix, landmarks.targets)

    state = problem.run(state, "markers", options.fields, closest, record)
    return ShapeFit(state.x, state.elastic.strains, record)


@dataclass(frozen=True)
class _State:
    coefficients: Array  # (k, 6)
    holds: Holds
    elastic: Elastic
    x: Array


@dataclass(frozen=True)
class _Change:
    """Of coefficients (k, 6), loose ends (6 e,) and x (n, 3), with the objective's slope along it."""

    strains: Array
    ends: Array
    x: Array
    slope: float


class _Problem:
    def __init__(self, mesh: TetMesh, options: ShapeOptions) -> None:
        self.options = options
        self.basis = SmoothStrains.of(mesh.tets, max(options.fields))
        self.elastic = Elastic(mesh.vertices, mesh.tets, options.material)
        self.guess = np.zeros((self.basis.fields.shape[1], 6))

    def begin(self, mesh: TetMesh, x: Array, holds: Holds) -> _State:
        """The equilibrium under the smoothest part of a guess's strains, without its extremes."""
        logs = np.clip(StretchField(mesh)(x), -GUESSED, GUESSED)
        coefficients = self.basis.project(logs)
        coefficients[SMOOTHEST:] = 0.0
        self.guess = coefficients
        return self.at(coefficients, holds, x)

    def at(self, coefficients: Array, holds: Holds, x: Array) -> _State:
        """The equilibrium under strains, searched from x."""
        elastic = self.elastic.with_strains(plasticity.exp(self.basis(coefficients)))
        found = equilibrium.solve([elastic, self.springs(holds)], x)
        return _State(coefficients, holds, elastic, found.x)

    def springs(self, holds: Holds) -> Attachment:
        return Attachment(holds.matrix, holds.targets, self.options.spring)

    def objective(self, state: _State, markers: Correspondence) -> float:
        change = state.coefficients - self.guess
        prior = self.basis.roughness(state.coefficients, self.options.volume)
        prior += self.options.strain * float((change**2 @ COUNTS).sum())
        fit = self.options.alpha * markers.energy(state.x)
        hold = self.options.beta * float((state.holds.errors(state.x) ** 2).sum())
        hold += self.options.loose * float((state.holds.departures() ** 2).sum())
        return 0.5 * (prior + fit + hold)

    def run(
        self,
        state: _State,
        stage: str,
        fields: Sequence[int],
        find: Callable[[_State], Correspondence],
        record: list[Iteration],
    ) -> _State:
        for count in fields:
            for _ in range(self.options.iterations):
                begin = time.perf_counter()
                markers = find(state)
                before = self.objective(state, markers)
                state, step = self.improve(state, markers, before, count)
                after = self.objective(state, markers)
                record.append(self.measure(state, f"{stage} {count}", after, step, markers, begin))
                self.report(record[-1])
                if step < 0.01 or before - after < self.options.progress * before:
                    break
                if markers.count and record[-1].marker_max < self.options.enough:
                    return state
        return state

    def improve(
        self, state: _State, markers: Correspondence, before: float, count: int
    ) -> tuple[_State, float]:
        """One Gauss-Newton step (Wang 2021 Eq. 5.8) with the longest of the steps 1, 1/2, 1/4... that lowers
        the objective.
        """
        change = self.direction(state, markers, count)
        step = 1.0
        while step >= 0.01:
            try:
                trial = self.changed(state, change, step)
            except ConvergenceError:
                step *= 0.25
                continue
            if self.objective(trial, markers) <= before + 0.1 * step * change.slope:
                return trial, step
            step *= 0.5
        return state, 0.0

    def changed(self, state: _State, change: _Change, step: float) -> _State:
        """The equilibrium after a step."""
        coefficients, holds = (
            state.coefficients + step * change.strains,
            state.holds.moved(step * change.ends),
        )
        return self.at(coefficients, holds, state.x + step * change.x)

    def direction(self, state: _State, markers: Correspondence, count: int) -> _Change:
        """The Gauss-Newton step in `count` fields and the motions of loose ends."""
        holds, o = state.holds, self.options
        x_by, targets_by = self.derivatives(state, count)
        rows, residuals = markers.rows(state.x)
        terms = (
            (o.alpha, rows @ x_by, residuals),
            (o.beta, holds.wide @ x_by - targets_by, holds.errors(state.x).ravel()),
            (o.loose, targets_by, holds.departures().ravel()),
        )
        gradient = np.sum([weight * (by.T @ error) for weight, by, error in terms], axis=0)
        hessian = np.sum([weight * (by.T @ by) for weight, by, _ in terms], axis=0)
        prior, near = self.basis.first(count).prior(o.volume), o.strain * np.tile(COUNTS, count)
        strains = len(prior)
        away = (state.coefficients - self.guess)[:count].ravel()
        gradient[:strains] += prior @ state.coefficients[:count].ravel() + near * away
        hessian[:strains, :strains] += prior + np.diag(near)
        hessian[np.diag_indices_from(hessian)] += 1e-9 * np.trace(hessian) / len(hessian)
        solution = -np.linalg.solve(hessian, gradient)
        change = np.zeros_like(state.coefficients)
        change[:count] = solution[:strains].reshape(-1, 6)
        x = (x_by @ solution).reshape(-1, 3)
        return _Change(change, solution[strains:], x, float(gradient @ solution))

    def derivatives(self, state: _State, count: int) -> tuple[Array, Array]:
        """Derivatives of x (3 n, u) and of the holds' targets (3 t, u) by the unknowns: coefficients of
        `count` fields, then motions of loose ends.

        x follows the strains by J = -K^-1 d(gradient)/dS (Wang 2021 Eq. 5.10), and loose ends by their
        springs.
        """
        holds = state.holds
        chain = plasticity.per_tet_operator(plasticity.exp_derivative(self.basis(state.coefficients)))
        forces = self.basis.first(count).times((state.elastic.strain_jacobian(state.x) @ chain).tocsr())
        moved = holds.by_motions()
        pulls = self.options.spring * (holds.wide.T @ moved)
        x_by = self.tangent(state).solve(np.hstack([-forces, pulls]))
        return x_by, np.hstack([np.zeros((len(moved), forces.shape[1])), moved])

    def tangent(self, state: _State):  # type: ignore[no-untyped-def]
        matrix = state.elastic.hessian(state.x) + self.springs(state.holds).hessian(state.x)
        try:
            return factorise(matrix.tocsr(), positive=False)
        except SingularMatrix as error:
            raise ConvergenceError(
                "Shape from plastic strains", "the stiffness matrix is singular"
            ) from error

    def measure(
        self, state: _State, stage: str, objective: float, step: float, markers: Correspondence, begin: float
    ) -> Iteration:
        errors = markers.distances(state.x)
        attached = np.linalg.norm(state.holds.errors(state.x), axis=1)
        return Iteration(
            stage=stage,
            objective=objective,
            marker_mean=float(errors.mean()) if len(errors) else 0.0,
            marker_max=float(errors.max(initial=0.0)),
            attachment_max=float(attached.max(initial=0.0)),
            eigenvalue=float(plasticity.eigenvalues(state.elastic.strains).min()),
            step=step,
            seconds=time.perf_counter() - begin,
        )

    def report(self, i: Iteration) -> None:
        text = "%s: objective %.4g, markers %.3f (%.3f) mm, attachments %.3f mm, eigenvalue %.2f, step %.2f"
        log.info(
            text, i.stage, i.objective, i.marker_mean, i.marker_max, i.attachment_max, i.eigenvalue, i.step
        )
