"""Pressure inside muscles, by which each keeps its volume as a whole: water does not leave it.

Elements alone do not see to it: as stiff against changes of volume as muscle is, linear tets lock.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from handpipe.core import Array, ConvergenceError
from handpipe.fem.minimisation import Record
from handpipe.fem.solver import Equilibrium, Options, solve
from handpipe.synthetic.continuum.density import DensityPotential, semidefinite
from handpipe.synthetic.continuum.determinant import cofactors, second_derivatives
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.coupled.coupled_body import CoupledBody, CoupledPose
from handpipe.synthetic.coupled.uninverted import uninverted
from handpipe.synthetic.coupled.validation import volume_changes

log = logging.getLogger(__name__)

KEPT = 2e-3  # largest relative change of a muscle's volume that remains
ROUNDS = 12  # of the search for pressures
COMPLIANCES = (0.1, 1.5)  # of the material's own: range of a muscle's compliance within its surroundings


class Pressure(DensityPotential):
    """Energy -sum of V p (det F - 1): a pressure p in kPa at every point of a cell, one a cell (m,)."""

    by_point = ("_pressures",)

    def __init__(self, elements: Elements, pressures: Array) -> None:
        super().__init__(elements)
        self._pressures = np.repeat(pressures, self._points)

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa: minus the pressure times the relative change of volume."""
        return -self._pressures[points] * (np.linalg.det(f) - 1.0)

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa: minus the pressure times the cofactors of F."""
        return -self._pressures[points, None, None] * cofactors(f)

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order; semidefinite with `project`."""
        exact = -self._pressures[points, None, None] * second_derivatives(f)
        return semidefinite(exact) if project else exact


def with_volumes_kept(
    body: CoupledBody, pose: CoupledPose, x: Array, options: Options | None = None, right: Array | None = None
) -> Equilibrium:
    """The equilibrium of a pose in which each muscle's volume is within 0.2 % of that at rest.

    x (n, 3) is the equilibrium without; right: as of `uninverted`. Pressures, one a muscle, are the volumes'
    Lagrange multipliers, found by the secant method.

    Raises
    ------
    ConvergenceError
        If volumes cannot be kept, or tissue stays inverted.
    """
    options = options or Options(name="volumes")
    tets = list(body.muscles.values())
    without = body.energies(pose)
    inside = body.elements.part(np.concatenate(tets))
    own = np.array([1.0 / body.solid.bulk_moduli()[t].mean() for t in tets])  # of relative volume, in 1/kPa
    compliance, pressures, record = own, np.zeros(len(tets)), Record(converged=True)
    change = _changes(body, x)
    for number in range(ROUNDS):
        log.info("%s: volumes changed by up to %.2f %%", options.name, 100 * np.abs(change).max())
        if np.abs(change).max() <= KEPT:
            return Equilibrium(x, record)
        step = -change / compliance
        pressures = pressures + step
        energies = [*without, Pressure(inside, np.repeat(pressures, list(map(len, tets))))]
        named = replace(options, name=f"{options.name}, volumes {number + 1}")
        found = uninverted(body, energies, solve(energies, x, fixed=body.fixed, options=named), named, right)
        x = found.x
        record.add(found.record)
        before, change = change, _changes(body, x)
        low, high = (share * own for share in COMPLIANCES)
        compliance = np.clip((change - before) / np.where(step == 0, np.inf, step), low, high)
    largest = 100 * np.abs(change).max()
    raise ConvergenceError(options.name, f"a muscle's volume stays {largest:.1f} % off after {ROUNDS} rounds")


def _changes(body: CoupledBody, x: Array) -> Array:
    """Relative change (k,) of each muscle's volume."""
    return np.array(list(volume_changes(body, x).values())) / 100.0
