"""Small multiples of the hard cases: each case's start and end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib

from handpipe.core import Array

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

if TYPE_CHECKING:
    from benchmarks.fem.cases import Outcome


CASES_ACROSS = 3
LIGHT = np.array([0.3, -0.7, 0.65])


def draw(names: Sequence[str], good: Sequence[bool], outcomes: Sequence[Outcome | None], path: Path) -> None:
    """Start and end of every case side by side, to a PNG; titles of failing cases are red."""
    down = -(-len(names) // CASES_ACROSS)
    figure = plt.figure(figsize=(2 * CASES_ACROSS * 2.6, down * 2.7), dpi=80)
    for number, (name, well, outcome) in enumerate(zip(names, good, outcomes, strict=True)):
        for column, state in enumerate(("start", "end")):
            axes = figure.add_subplot(down, 2 * CASES_ACROSS, 2 * number + column + 1, projection="3d")
            axes.set_axis_off()
            title = f"{name}: {state}" if column == 0 else ("good" if well else "fails")
            axes.set_title(title, fontsize=8, color="black" if well else "darkred")
            if outcome is not None:
                shape(axes, outcome.start if column == 0 else outcome.x, outcome)
    figure.subplots_adjust(0, 0, 1, 1 - 0.3 / (down * 2.7), 0, 0.12)
    figure.savefig(path)
    plt.close(figure)


def shape(axes: Axes3D, x: Array, outcome: Outcome) -> None:
    """Triangles of the elastic bodies opaque, those of shells as a wireframe."""
    triangles = outcome.triangles
    soft = np.isin(triangles, outcome.elastic.tets).all(axis=1)
    corners = x[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    shade = 0.55 + 0.45 * (normals @ LIGHT) / np.maximum(lengths[:, 0], 1e-300)
    colours = np.clip(shade, 0.15, 1.0)[:, None] * np.array([0.95, 0.72, 0.6])
    axes.add_collection3d(
        Poly3DCollection(corners[soft], facecolors=colours[soft], edgecolors=(0, 0, 0, 0.35), linewidths=0.2)
    )
    if not soft.all():
        wires = Poly3DCollection(
            corners[~soft], facecolors=(0, 0, 0, 0), edgecolors=(0.1, 0.2, 0.6, 0.5), linewidths=0.3
        )
        axes.add_collection3d(wires)
    centre, reach = (x.max(axis=0) + x.min(axis=0)) / 2, max(float(np.ptp(x, axis=0).max()) / 2, 1e-3)
    axes.set(**{f"{a}lim": (c - reach, c + reach) for a, c in zip("xyz", centre, strict=True)})
    axes.set_box_aspect((1, 1, 1), zoom=1.45)
    axes.view_init(elev=22, azim=-65)
