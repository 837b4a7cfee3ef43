"""The toy finger cut open, and how its error falls with refinement."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from handpipe.core import Array, IntArray, atomic
from handpipe.synthetic.coupled.coupled_body import CoupledBody

COLOURS = {"skin": "#e3a982", "fat": "#f6e5a8"}
MUSCLE, STRAND = "#b4423c", "#ffffff"


def section(vertices: Array, tets: IntArray) -> tuple[list[Array], IntArray]:
    """Polygons (k, 2) in x and z where the plane y = 0 cuts tets, and which tets it cuts."""
    height = vertices[:, 1] + 1e-6
    upper = (height[tets] > 0).sum(axis=1)
    cut = np.flatnonzero((upper > 0) & (upper < 4))
    polygons = []
    for tet in tets[cut]:
        above, below = tet[height[tet] > 0], tet[height[tet] <= 0]
        pairs = [(a, b) for a in above for b in below]
        if len(pairs) == 4:
            pairs = [pairs[0], pairs[1], pairs[3], pairs[2]]
        share = np.array([height[a] / (height[a] - height[b]) for a, b in pairs])[:, None]
        first, second = (vertices[[p[i] for p in pairs]] for i in range(2))
        polygons.append(((1 - share) * first + share * second)[:, [0, 2]])
    return polygons, cut


def draw(axes: Axes, body: CoupledBody, x: Array) -> None:
    """The body at x (n, 3) cut open; quadratic tets as the eight between their nodes."""
    polygons, cut = section(x, body.cells.tets)
    names = [body.anatomy.regions[label] for label in body.cell_labels[cut]]
    faces = [COLOURS.get(name, MUSCLE) for name in names]
    axes.add_collection(PolyCollection(polygons, facecolors=faces, edgecolors="#00000040", linewidths=0.3))
    for name in body.strands:
        line = body.strand_points(name) @ x
        axes.plot(line[:, 0], line[:, 2], "-", color=STRAND, linewidth=1.5)
    axes.set_aspect("equal")
    axes.autoscale()
    axes.set_xlabel("mm")


def cut_open(path: Path, body: CoupledBody, x: Array) -> None:
    """The body at rest and at x (n, 3)."""
    figure = Figure(figsize=(15, 6.5), layout="constrained")
    for axes, positions in zip(figure.subplots(1, 2), (body.rest, x), strict=True):
        draw(axes, body, positions)
    _save(figure, path, 90)


def convergence(path: Path, table: Mapping[str, Mapping[str, float]]) -> None:
    """Root mean square distance from the finest body over nodes, of both kinds of elements."""
    figure = Figure(figsize=(6, 4.5), layout="constrained")
    axes = figure.subplots()
    for order, name in ((1, "linear"), (2, "quadratic")):
        rows = sorted((row for row in table.values() if row["order"] == order), key=lambda row: row["nodes"])
        rows = [row for row in rows if row["rms"] > 1e-9]
        axes.loglog([r["nodes"] for r in rows], [r["rms"] for r in rows], "o-", label=f"{name} tets")
    axes.set_xlabel("nodes")
    axes.set_ylabel("rms distance from the finest body (mm)")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    _save(figure, path, 110)


def _save(figure: Figure, path: Path, dpi: int) -> None:
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=dpi)
