"""The string of Wang 2021 §5.9.5: attached at 0 and 2, its quarter fixed at 1/4 and its middle at 3/2.

Slopes of 1, 5 and 1 are asked for. The string is a thin bar of tets without Poisson's effect, fitted by the
tool for organs. It lies in a tube: without one it buckles sideways, and its positions along the line say
nothing. Beside it are the interpolating curves of least second and third derivative (Wang 2021 Eq. 5.25 with
marks met exactly), what Wang's and our objective give on a line, and how far each slope leaves the interval
from 1 to 5 (docs/shapes-string.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.interpolate import make_interp_spline

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import bar
from benchmarks.shapes.string_theory import (
    KNOTS,
    SLOPES,
    TARGETS,
    Slopes,
    logarithmic_1d,
    plastic_1d,
)
from handpipe.core import Array, atomic
from handpipe.fem.contact import Sliding
from handpipe.fem.elements import Material
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs import Observed, fit_organ
from handpipe.shapes.organs.organ import OrganFit

PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "shapes-string.png"
LENGTH = 100.0  # mm
TUBE = 1.0  # mN/mm of a vertex across the string
STIFFNESSES = (1e6, 1e3, 100.0, 30.0, 10.0, 1.0, 0.01)  # beta of Wang 2021 Eq. 5.26
STIFF, SOFT = STIFFNESSES[0], STIFFNESSES[-1]


def fitted(cells: int, tube: float = TUBE) -> OrganFit:
    """The string of that many cells; tube: stiffness in mN/mm of its lateral springs (0: none)."""
    side = LENGTH / cells
    mesh = bar((cells, 1, 1), (LENGTH, side, side))
    x = mesh.vertices
    at = {knot: x[np.abs(x[:, 0] - LENGTH * knot) < 1e-9] for knot in KNOTS}
    moved = {
        k: points + [LENGTH * (t - k), 0.0, 0.0] for (k, points), t in zip(at.items(), TARGETS, strict=True)
    }

    def pairs(*knots: float) -> Pairs:
        return Pairs(np.concatenate([at[k] for k in knots]), np.concatenate([moved[k] for k in knots]))

    settings = OrganSettings(alpha=10.0, beta=10.0, material=Material(6.0, 0.0), remesh_below=0.0)
    observed = Observed(attachments=pairs(0.0, 1.0), landmarks=pairs(0.25, 0.5))
    return fit_organ(mesh, observed, loads=_tube(mesh, tube) if tube else (), settings=settings)


def _tube(mesh: TetMesh, stiffness: float) -> list[Sliding]:
    """Springs of all vertices towards their places across the string, none along it."""
    every = sp.identity(len(mesh.vertices), format="csr")
    across = np.eye(3)[1:]
    return [Sliding(every, mesh.vertices, np.tile(n, (len(mesh.vertices), 1)), stiffness) for n in across]


def profile(fit: OrganFit, cells: int) -> Array:
    """Positions (cells + 1,) along the string, in its rest length."""
    layer = np.round(fit.rest.vertices[:, 0] * cells / LENGTH).astype(int)
    return np.bincount(layer, fit.mesh.vertices[:, 0]) / np.bincount(layer) / LENGTH


def buckled(fit: OrganFit) -> float:
    """Largest lateral move of a vertex in mm."""
    return float(np.abs(fit.mesh.vertices - fit.rest.vertices)[:, 1:].max())


def slopes(positions: Array) -> Array:
    """Mean slopes (3,) of the three intervals of equally spaced positions."""
    at = np.round(KNOTS * (len(positions) - 1)).astype(int)
    return np.diff(positions[at]) / np.diff(KNOTS)


def variational(order: int, points: Array) -> Array:
    """Slopes of the interpolating curve whose derivative of that order has the least square."""
    ends = [(d, 0.0) for d in range(order, 2 * order - 1)]
    curve = make_interp_spline(KNOTS, TARGETS, k=2 * order - 1, bc_type=(ends, ends) if ends else None)
    return np.asarray(curve.derivative()(points))


def measure(cells: int = 40, picture: Path | None = PICTURE) -> Figures:
    """`string_…`: slopes on the three intervals, the largest relative error of them, peaks and overshoot."""
    fit = fitted(cells)
    ours = Slopes(np.diff(profile(fit, cells)) * cells)
    found = slopes(ours.positions)
    middles = (np.arange(cells) + 0.5) / cells
    out: Figures = {f"string_slope_{i + 1}": figure(float(s), "1") for i, s in enumerate(found)}
    out["string_slope_error"] = figure(float(np.abs(found / SLOPES - 1).max()), "1")
    out["string_buckled"] = figure(buckled(fit), "mm")
    curves = {"ours": ours, "line": logarithmic_1d(2 * cells), "line_order_1": logarithmic_1d(2 * cells, 1)}
    curves |= {f"variational_{order}": Slopes(variational(order, middles)) for order in (1, 2, 3)}
    curves |= {f"wang_{beta:g}": plastic_1d(2 * cells, beta) for beta in STIFFNESSES}
    for name, curve in curves.items():
        key = "string_{}" if name == "ours" else f"string_{{}}_{name}"
        out[key.format("overshoot")] = figure(curve.overshoot, "1")
        out[key.format("peak")] = figure(float(curve.local.max()), "1")
        out[key.format("least")] = figure(float(curve.local.min()), "1")
    for beta in (100.0, 1.0):
        missed = missed_without_overshoot(cells, beta)
        out[f"string_missed_at_peak_5_wang_{beta:g}"] = figure(missed, "1")
    if picture is not None:
        draw(picture, curves)
    return out


def missed_without_overshoot(cells: int, stiffness: float) -> float:
    """By how much (string's length 1) Wang 2021 Eq. 5.26 misses a mark where its peak slope is 5."""
    low, high = 0.0, 7.0  # decimal logarithms of alpha
    for _ in range(12):
        middle = 0.5 * (low + high)
        if plastic_1d(cells, stiffness, 10**middle).local.max() < SLOPES.max():
            low = middle
        else:
            high = middle
    return plastic_1d(cells, stiffness, 10**low).missed


def draw(path: Path, curves: dict[str, Slopes]) -> None:
    """Positions and slopes along the string."""
    shown = {
        "variational_1": ("least |x'|", "C0:"),
        "variational_3": ("least |x'''|", "C3:"),
        f"wang_{STIFF:g}": ("Wang's objective, stiff = least |x''|", "C2-"),
        "wang_30": ("Wang's objective, beta 30", "C4-"),
        "line": ("ours, on a line", "k--"),
        "ours": ("ours, tets", "C1-"),
    }
    drawing = Figure(figsize=(10, 4), layout="constrained")
    left, right = drawing.subplots(1, 2)
    for name, (label, style) in shown.items():
        local = curves[name].local
        at = (np.arange(len(local)) + 0.5) / len(local)
        left.plot(np.linspace(0, 1, len(local) + 1), curves[name].positions, style, label=label)
        right.plot(at, local, style, label=label)
    left.plot(KNOTS, TARGETS, "ko")
    right.hlines(SLOPES, KNOTS[:-1], KNOTS[1:], colors="0.7", linewidth=5, zorder=0, label="asked for")
    left.set_ylabel("position")
    right.set_ylabel("slope")
    for ax in (left, right):
        ax.set_xlabel("place at rest")
    right.legend(fontsize=8)
    FigureCanvasAgg(drawing)
    with atomic(path) as temporary:
        drawing.savefig(temporary, format="png", dpi=100)
