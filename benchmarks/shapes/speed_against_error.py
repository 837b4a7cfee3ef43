"""Mesh size, number of marks and tolerance against surface error and processor seconds, on one organ.

One setting is changed at a time from the usual ones. The surface is compared with the true map's on a fine
mesh, so that a coarse template's own facets count as errors, as they do for whoever uses the result.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import liver, scattered, surface_errors
from benchmarks.shapes.hard_case_scenes import SIZE
from benchmarks.shapes.organs import grown_liver
from handpipe.core import atomic
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs import Observed, fit_organ

log = logging.getLogger("benchmarks.shapes")

EDGES = (4.0, 3.2, 2.5, 2.0)  # mm
MARKS = (25, 50, 100, 200)
ENOUGH = (1.0, 0.3, 0.05, 0.01)  # mm
PROGRESS = (0.3, 0.1, 0.01)
USUAL = {"edge": 2.5, "marks": 100, "enough": OrganSettings().enough, "progress": OrganSettings().progress}
UNITS = {"edge": "mm", "marks": "", "enough": "mm", "progress": ""}
PREFIX = "speed_"


@dataclass(frozen=True)
class Point:
    """One setting of one study: distances of the surfaces in mm, steps, and the processor's seconds."""

    study: str
    at: float
    tets: int
    mean: float
    largest: float
    steps: int
    seconds: float


def measure(
    edges: Sequence[float] = EDGES,
    marks: Sequence[int] = MARKS,
    enough: Sequence[float] = ENOUGH,
    progress: Sequence[float] = PROGRESS,
    fine: float = 1.2,
) -> Figures:
    """`speed_…_{study}_{setting}`."""
    truth = grown_liver(liver(fine, SIZE))
    studies: dict[str, Sequence[float]] = {
        "edge": edges,
        "marks": marks,
        "enough": enough,
        "progress": progress,
    }
    figures: Figures = {}
    run(truth, {**USUAL, "edge": edges[0]}, "compiles")
    for study, values in studies.items():
        for value in values:
            point = run(truth, {**USUAL, study: value}, study)
            log.info("%s", point)
            key = f"{study}_{value:g}"
            figures |= {
                f"{PREFIX}tets_{key}": figure(float(point.tets), "1"),
                f"{PREFIX}surface_mean_{key}": figure(point.mean, "mm"),
                f"{PREFIX}surface_max_{key}": figure(point.largest, "mm"),
                f"{PREFIX}steps_{key}": figure(float(point.steps), "1"),
                f"{PREFIX}seconds_{key}": figure(point.seconds, "s"),
            }
    return figures


def run(truth: TetMesh, setting: Mapping[str, float], study: str) -> Point:
    """The free organ, fitted to marks on the true surface."""
    mesh = liver(setting["edge"], SIZE)
    points = scattered(truth.boundary(), int(setting["marks"]))
    settings = OrganSettings(enough=setting["enough"], progress=setting["progress"])
    begun = time.process_time()
    fit = fit_organ(mesh, Observed(points), settings=settings)
    seconds = time.process_time() - begun
    errors = surface_errors(fit.mesh, truth)
    return Point(
        study=study,
        at=setting.get(study, 0.0),
        tets=len(mesh.tets),
        mean=float(errors.mean()),
        largest=float(errors.max()),
        steps=len(fit.record),
        seconds=seconds,
    )


def points(figures: Mapping[str, Mapping[str, object]]) -> list[Point]:
    """What `measure` has put into the figures."""
    found = []
    for name in figures:
        if not name.startswith(f"{PREFIX}tets_"):
            continue
        key = name.removeprefix(f"{PREFIX}tets_")
        study, at = key.split("_")
        mean, largest, seconds, tets, steps = (
            float(str(figures[f"{PREFIX}{what}_{key}"]["value"]))
            for what in ("surface_mean", "surface_max", "seconds", "tets", "steps")
        )
        found.append(Point(study, float(at), int(tets), mean, largest, int(steps), seconds))
    return sorted(found, key=lambda p: (list(UNITS).index(p.study), p.at))


def table(found: Sequence[Point]) -> str:
    """The settings as Markdown."""
    lines = [
        "| setting | tets | surface mean, farthest [mm] | steps | processor seconds |",
        "| --- | --- | --- | --- | --- |",
    ]
    for p in found:
        name = " ".join([p.study, f"{p.at:g}", UNITS[p.study]]).strip()
        lines.append(f"| {name} | {p.tets} | {p.mean:.3f}, {p.largest:.2f} | {p.steps} | {p.seconds:.1f} |")
    return "\n".join(lines)


def draw(found: Sequence[Point], path: Path) -> None:
    """Mean errors over seconds, a panel for each study."""
    studies = list(dict.fromkeys(p.study for p in found))
    sheet = Figure(figsize=(3.2 * len(studies), 3.2), layout="constrained")
    panels = np.atleast_1d(sheet.subplots(1, len(studies), sharex=True, sharey=True))
    for axes, study in zip(panels, studies, strict=True):
        shown = [p for p in found if p.study == study]
        axes.loglog([p.seconds for p in shown], [p.mean for p in shown], "o-", markersize=4, linewidth=1)
        for p in shown:
            axes.annotate(
                f"{p.at:g}", (p.seconds, p.mean), xytext=(4, 4), textcoords="offset points", fontsize=7
            )
        axes.set_title(f"{study} {f'[{UNITS[study]}]' if UNITS[study] else ''}".strip(), fontsize=10)
        axes.set_xlabel("processor seconds")
        axes.grid(True, which="both", linewidth=0.3)
    panels[0].set_ylabel("mean surface error [mm]")
    FigureCanvasAgg(sheet)
    with atomic(path) as temporary:
        sheet.savefig(temporary, dpi=90)
