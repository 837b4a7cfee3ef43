"""Combinations of the smoothest strain fields as unknowns, near the strains of a guess."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from handpipe.core import Array, ConvergenceError
from handpipe.fem.elements import plasticity
from handpipe.fem.linear import SingularMatrix, factorise
from handpipe.fem.potentials import Potential
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.optimisation.settings import ShapeOptions
from handpipe.shapes.optimisation.strain_space import NOTHING, Stage, State, Step
from handpipe.shapes.strains.smooth_strains import SmoothStrains
from handpipe.shapes.strains.stretch import COUNTS, StretchField

SMOOTHEST = 30  # strain fields of a guess that are kept
GUESSED = 0.4  # largest log-strain that is kept of a guess: a blend of bone motions crushes some tets


class SmoothFields:
    """Coefficients (k, 6) of smooth fields of log-strains. Loose ends are unknowns of its steps besides.

    guess (k, 6): the smoothest part of a guess's strains, without its extremes.
    """

    def __init__(self, mesh: TetMesh, start: Array, options: ShapeOptions) -> None:
        """mesh: at rest; start (n, 3): vertices of the guess."""
        self.options = options
        self.basis = SmoothStrains.compute(mesh.tets, max(options.fields))
        self.guess = self.basis.project(np.clip(StretchField(mesh)(start), -GUESSED, GUESSED))
        self.guess[SMOOTHEST:] = 0.0

    def zero(self) -> Array:
        """No strain (k, 6)."""
        return np.zeros_like(self.guess)

    def logs(self, unknowns: Array) -> Array:
        """Log-strains (m, 6)."""
        return self.basis(unknowns)

    def plastic(self, unknowns: Array) -> Array:
        """Plastic strains (m, 6)."""
        return plasticity.exp(self.basis(unknowns))

    def prior(self, unknowns: Array) -> float:
        """|L S|^2 + volume |tr S|^2 + strain |S - S_guess|^2."""
        near = self.options.strain * float(((unknowns - self.guess) ** 2 @ COUNTS).sum())
        return self.basis.roughness(unknowns, self.options.volume) + near

    def step(self, state: State, external: Sequence[Potential], marks: Correspondence, stage: Stage) -> Step:
        """In the first `fields` fields and the motions of loose ends."""
        count = len(self.guess) if stage.fields is None else min(stage.fields, len(self.guess))
        attachments, o = state.attachments, self.options
        x_by, targets_by = self._derivatives(state, external, count)
        rows, residuals = marks.rows(state.x)
        terms = (
            (stage.weight, rows @ x_by, residuals),
            (o.beta, attachments.wide @ x_by - targets_by, attachments.errors(state.x).ravel()),
            (o.loose, targets_by, attachments.departures().ravel()),
        )
        gradient = np.sum([weight * (by.T @ error) for weight, by, error in terms], axis=0)
        hessian = np.sum([weight * (by.T @ by) for weight, by, _ in terms], axis=0)
        prior, near = self.basis.first(count).prior(o.volume), o.strain * np.tile(COUNTS, count)
        strains = len(prior)
        away = (state.unknowns - self.guess)[:count].ravel()
        gradient[:strains] += prior @ state.unknowns[:count].ravel() + near * away
        hessian[:strains, :strains] += prior + np.diag(near)
        hessian[np.diag_indices_from(hessian)] += 1e-9 * np.trace(hessian) / len(hessian)
        solution = -np.linalg.solve(hessian, gradient)
        change = np.zeros_like(state.unknowns)
        change[:count] = solution[:strains].reshape(-1, 6)
        motion = (x_by @ solution).reshape(-1, 3)
        return Step(change, motion, float(gradient @ solution), ends=solution[strains:], loose=NOTHING)

    def _derivatives(self, state: State, external: Sequence[Potential], count: int) -> tuple[Array, Array]:
        """Derivatives of x (3 n, u) and of the attachments' targets (3 t, u) by the unknowns.

        The unknowns are the coefficients of `count` fields, then motions of loose ends. x follows the strains
        by J = -K^-1 d(gradient)/dS (Wang 2021 Eq. 5.10), and loose ends by their springs.
        """
        attachments = state.attachments
        chain = plasticity.per_tet_operator(plasticity.exp_derivative(self.basis(state.unknowns)))
        forces = self.basis.first(count).times((state.body.strain_jacobian(state.x) @ chain).tocsr())
        moved = attachments.by_motions()
        pulls = self.options.spring * (attachments.wide.T @ moved)
        x_by = _tangent(state, external).solve(np.hstack([-forces, pulls]))
        return x_by, np.hstack([np.zeros((len(moved), forces.shape[1])), moved])


def _tangent(state: State, external: Sequence[Potential]) -> Any:
    matrix = state.body.hessian(state.x)
    for potential in external:
        matrix = matrix + potential.hessian(state.x)
    try:
        return factorise(matrix.tocsr(), positive=False)
    except SingularMatrix as error:
        raise ConvergenceError("Shape from plastic strains", "the stiffness matrix is singular") from error
