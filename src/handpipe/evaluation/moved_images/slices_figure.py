"""Slices of one pose through several images, with the simulated contours over each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from handpipe.core import Shapes, atomic
from handpipe.evaluation.pictures import contours
from handpipe.evaluation.slices import Plane, Sample, draw_slice

WIDTH, HEIGHT = 3.6, 2.6  # inches of a slice
DPI = 100  # 1/inch


@dataclass(frozen=True)
class Row:
    """An image that a row of slices shows.

    Parameters
    ----------
    name : str
        What it is, for the title.
    sample : callable
        Grey values (n,) at points (n, 3) in mm, the root bone at rest.
    grey : tuple of float
        Grey values that are black and white.
    """

    name: str
    sample: Sample
    grey: tuple[float, float]


def write_slices(
    path: str | Path, rows: Sequence[Row], planes: Mapping[str, Plane], layers: Mapping[str, Shapes]
) -> None:
    """Write a PNG of slices: a row for each image, a column for each plane, simulated contours over all.

    Parameters
    ----------
    path : path
        File to be written.
    rows : sequence of Row
        Images, from top to bottom.
    planes : mapping of str to Plane
        Planes by name, from left to right.
    layers : mapping of str to Shapes
        Simulated shapes by layer and body, whose contours are drawn.
    """
    drawn = contours(layers, {})
    figure = Figure(figsize=(WIDTH * len(planes), HEIGHT * len(rows) + 0.5), layout="constrained")
    grid = figure.subplots(len(rows), len(planes), squeeze=False)
    seen: set[str] = set()
    for axes, row in zip(grid, rows, strict=True):
        for ax, (title, plane) in zip(axes, planes.items(), strict=True):
            found = draw_slice(ax, row.sample, plane, drawn, grey=row.grey)
            seen |= {name for name, segments in found.items() if len(segments)}
            ax.set_title(f"{row.name}: {title}", fontsize=9)
            ax.tick_params(labelsize=7)
            ax.set(xlabel="", ylabel="")
    handles = [Line2D([], [], color=c.colour, label=c.name) for c in drawn if c.name in seen]
    legend = figure.legend(
        handles=handles, loc="outside lower center", ncols=8, fontsize=8, facecolor="#333333"
    )
    for text in legend.get_texts():
        text.set_color("white")
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI)
