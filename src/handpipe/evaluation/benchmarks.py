"""The figures of `snakemake benchmark_fem` as tables and drawings, for the report and the documents."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from handpipe.core import atomic
from handpipe.evaluation.table import Cell, Table

Figures = Mapping[str, tuple[Any, str]]  # as `handpipe.core.metrics.read` gives them; some are lists or texts

CURVES = "error_by_"
MARKERS = "osD^vP"
BARS = {  # figure -> what it is; those that the report lists
    "assembly_ms_230k": "energy, gradient and Hessian of 230,000 tets",
    "assembly_ratio_skfem": "assembly: scikit-fem's time over ours",
    "twist_ratio_skfem_24k": "twist, 24,000 tets: time of scikit-fem and pypardiso over ours",
    "twist_overhead_24k": "twist, 24,000 tets: time over time inside the linear solver",
    "twist_difference_24k": "twist, 24,000 tets: largest distance of the two solutions",
    "twist_one_step_seconds_24k": "the same turn in one step",
    "cost_exponent": "exponent of time over unknowns, 6,000 to 236,000 tets",
    "paper_fat_seconds": "one frame of a body of the size of the paper's fat, turned by 60 degrees",
    "paper_fat_factorisations": "its factorisations",
    "paper_fat_peak_memory": "its peak memory",
}


def benchmark_table(figures: Figures) -> Table | None:
    """The chief figures as a table; None where there are none."""
    rows: list[list[Cell]] = [
        [text, unit, f"{value:.4g}"]
        for name, text in BARS.items()
        if name in figures
        for value, unit in [figures[name]]
        if value is not None
    ]
    if not rows:
        return None
    note = f"Measured on {_machine(figures)}; more in docs/benchmarks.md."
    return Table("The equilibrium solver.", ["measure", "unit", "value"], rows, note)


def _machine(figures: Figures) -> str:
    processor = figures.get("machine_processor", ("an unknown processor", ""))[0]
    threads = figures.get("machine_threads", ("?", ""))[0]
    return f"{processor}, {threads} threads"


def error_figures(figures: Figures) -> dict[str, Figure]:
    """Error over seconds, a drawing for each study ("mesh and material", ...)."""
    studies: dict[str, dict[str, dict[str, list[float]]]] = {}
    for name, (value, _) in figures.items():
        if name.startswith(CURVES) and isinstance(value, list):
            study, _, rest = name.removeprefix(CURVES).partition(": ")
            curve, _, part = rest.rpartition(", ")
            studies.setdefault(study, {}).setdefault(curve, {})[part] = value
    return {study: _error_figure(curves) for study, curves in studies.items()}


def _error_figure(curves: Mapping[str, Mapping[str, list[float]]]) -> Figure:
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for (name, curve), marker in zip(curves.items(), MARKERS, strict=False):
        axes.loglog(curve["seconds"], curve["errors"], marker=marker, markersize=5, label=name)
    axes.set_xlabel("time of a solve [s]")
    axes.set_ylabel("displacement error, root mean square [mm]")
    axes.grid(True, which="major", linewidth=0.4)
    axes.legend(fontsize=9)
    return figure


def write_svg(path: str | Path, figure: Figure) -> None:
    """Write a drawing as SVG that is the same for the same figures."""
    figure.set_canvas(FigureCanvasSVG(figure))
    with atomic(path) as temporary, matplotlib.rc_context({"svg.hashsalt": "handpipe"}):
        figure.savefig(temporary, format="svg", metadata={"Date": None})
