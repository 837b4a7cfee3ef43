"""Dense against sparse correspondences: as marks get fewer, elastic energies fail (Wang 2021 Fig. 5.7).

The beam and the muscle of the comparisons, with marks spread over their sides, from 8 to all vertices. All
methods get the same marks.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import farthest, surface_errors
from benchmarks.shapes.comparison_bodies import BODIES, Body
from benchmarks.shapes.comparison_picture import LABELS
from benchmarks.shapes.comparisons import shape_by
from benchmarks.shapes.other_methods import METHODS
from handpipe.core import atomic

PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "shapes-density.png"
COUNTS = (8, 16, 32, 64, 128)  # marks; all vertices of the side after these
SHOWN = ("plastic", "elastic", "arap_volume", "biharmonic_volume", "bending", "icp_sumner")


def marked(body: Body, count: int) -> Body:
    """The body with so many marks on its side, evenly spread, and those of its other end."""
    x = body.mesh.vertices
    chosen = farthest(x[body.side], min(count, len(body.side)))
    number = {tuple(point): n for n, point in enumerate(x)}
    side = np.array([number[tuple(point)] for point in chosen])
    end = body.marked[np.isclose(x[body.marked, 0], x[:, 0].max())]
    return replace(body, marked=np.concatenate([side, end]))


def measure(counts: tuple[int, ...] = COUNTS, refinement: int = 1, image: Path | None = PICTURE) -> Figures:
    """`density_{body}_{method}_{marks}_mean` and `_max` in mm, of the whole surface; `_volume` in percent."""
    out: Figures = {}
    for name, make in BODIES.items():
        body = make(refinement)
        every = len(body.side)
        for count in (*counts, every):
            given = marked(body, count)
            for method in SHOWN:
                key = f"density_{name}_{method}_{'all' if count == every else count}_"
                found = shape_by(METHODS[method], given, method)
                if isinstance(found, str):
                    out |= {key + k: figure(None, u, found) for k, u in UNITS.items()}
                    continue
                fitted = body.mesh.moved(found[0])
                errors = surface_errors(fitted, body.wanted)
                volume = fitted.boundary().volume() / body.wanted.boundary().volume() - 1
                values = {"mean": errors.mean(), "max": errors.max(), "volume": 100 * volume}
                out |= {key + k: figure(float(values[k]), u) for k, u in UNITS.items()}
        out[f"density_{name}_all"] = figure(float(every), "1")
    if image is not None:
        draw(image, out, counts)
    return out


UNITS = {"mean": "mm", "max": "mm", "volume": "%"}


def draw(path: Path, figures: Figures, counts: tuple[int, ...]) -> None:
    """Mean error of the surface over the number of marks."""
    drawing = Figure(figsize=(9, 3.6), layout="constrained")
    for ax, name in zip(drawing.subplots(1, len(BODIES)), BODIES, strict=True):
        at = [*counts, figures[f"density_{name}_all"]["value"]]
        for number, method in enumerate(SHOWN):
            keys = [f"density_{name}_{method}_{n}_mean" for n in (*counts, "all")]
            values = [figures[key]["value"] for key in keys]
            width = 2.5 if method == "plastic" else 1.2
            ax.loglog(at, [np.nan if v is None else v for v in values], f"C{number}o-", linewidth=width)
        ax.set_title(name)
        ax.set_xlabel("marks on the side")
        ax.set_ylabel("surface, mean error [mm]")
    drawing.legend([LABELS[m] for m in SHOWN], loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    FigureCanvasAgg(drawing)
    with atomic(path) as temporary:
        drawing.savefig(temporary, format="png", dpi=100)
