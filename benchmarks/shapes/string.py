"""The string of Wang 2021 §5.9.5: attached at 0 and 2, its quarter fixed at 1/4 and its middle at 3/2.

Slopes of 1, 5 and 1 are asked for. The string is a thin bar of tets without Poisson's effect, fitted by the
tool for organs; beside it the interpolating curves of least second and third derivative (Wang 2021 Eq. 5.25
with marks met exactly), and how far each curve's slope leaves the interval from 1 to 5.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import bar
from handpipe.core import Array
from handpipe.fem.elements import Material
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs import Observed, fit_organ
from handpipe.shapes.organs.organ import OrganFit

LENGTH = 100.0  # mm
KNOTS, TARGETS = np.array([0.0, 0.25, 0.5, 1.0]), np.array([0.0, 0.25, 1.5, 2.0])
SLOPES = np.diff(TARGETS) / np.diff(KNOTS)


def fitted(cells: int) -> OrganFit:
    """The string of that many cells."""
    side = LENGTH / cells
    mesh = bar((cells, 1, 1), (LENGTH, side, side))
    x = mesh.vertices
    at = {knot: x[np.abs(x[:, 0] - LENGTH * knot) < 1e-9] for knot in KNOTS}
    moved = {
        k: points + [LENGTH * (t - k), 0.0, 0.0] for (k, points), t in zip(at.items(), TARGETS, strict=True)
    }

    def pairs(*knots: float) -> Pairs:
        return Pairs(np.concatenate([at[k] for k in knots]), np.concatenate([moved[k] for k in knots]))

    settings = OrganSettings(alpha=10.0, beta=10.0, material=Material(6.0, 0.0))
    return fit_organ(
        mesh, Observed(attachments=pairs(0.0, 1.0), landmarks=pairs(0.25, 0.5)), settings=settings
    )


def profile(fit: OrganFit, cells: int) -> Array:
    """Positions (cells + 1,) along the string, in its rest length."""
    layers = np.round(np.arange(cells + 1) * LENGTH / cells, 9)
    mesh = bar((cells, 1, 1), (LENGTH, LENGTH / cells, LENGTH / cells))
    index = np.searchsorted(layers, np.round(mesh.vertices[:, 0], 9))
    return np.bincount(index, fit.mesh.vertices[:, 0]) / np.bincount(index) / LENGTH


def slopes(positions: Array) -> Array:
    """Mean slopes (3,) of the three intervals of equally spaced positions."""
    at = np.round(KNOTS * (len(positions) - 1)).astype(int)
    return np.diff(positions[at]) / np.diff(KNOTS)


def overshoot(local: Array) -> float:
    """How far local slopes leave the interval from 1 to 5, in units of its width."""
    return float(max(SLOPES.min() - local.min(), local.max() - SLOPES.max(), 0.0) / np.ptp(SLOPES))


def variational(order: int, points: Array) -> Array:
    """Slopes of the interpolating curve whose derivative of that order has the least square."""
    ends = [(d, 0.0) for d in range(order, 2 * order - 1)]
    curve = make_interp_spline(KNOTS, TARGETS, k=2 * order - 1, bc_type=(ends, ends))
    return np.asarray(curve.derivative()(points))


def measure(cells: int = 40) -> Figures:
    """`string_…`: slopes on the three intervals, the largest relative error of them, and overshoot."""
    positions = profile(fitted(cells), cells)
    found = slopes(positions)
    middles = (np.arange(cells) + 0.5) / cells
    out: Figures = {f"string_slope_{i + 1}": figure(float(s), "1") for i, s in enumerate(found)}
    out["string_slope_error"] = figure(float(np.abs(found / SLOPES - 1).max()), "1")
    out["string_overshoot"] = figure(overshoot(np.diff(positions) * cells), "1")
    for order in (2, 3):
        out[f"string_overshoot_variational_{order}"] = figure(overshoot(variational(order, middles)), "1")
    return out
