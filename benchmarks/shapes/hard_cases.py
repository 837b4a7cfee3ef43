"""Judges the hard cases of organs, each against the true shape alone."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import surface_errors
from benchmarks.shapes.hard_case_scenes import CASES, Case, Scene
from handpipe.core import HandpipeError
from handpipe.shapes.organs import Observed, fit_organ
from handpipe.shapes.organs.organ import OrganFit

log = logging.getLogger("benchmarks.shapes")

GOOD, NOTICED, MISSED, ALARM = "good", "noticed", "missed", "false alarm"
EDGE = 2.5  # mm
PREFIX = "hard_case_"


@dataclass(frozen=True)
class Row:
    """What came of a case: distances in mm of the whole surface from the true one, smallest dihedral angles
    in degrees, what was said of the input, what is beyond the bars, the verdict, the processor's seconds.
    """

    mean: float
    largest: float
    dihedral_before: float
    dihedral: float
    said: list[str]
    beyond: list[str]
    verdict: str
    seconds: float


def measure(edge: float = EDGE, cases: Sequence[str] = tuple(CASES)) -> Figures:
    """`hard_case_…_{name}`: what came of each case, and how many are good, noticed and missed."""
    figures: Figures = {}
    verdicts = []
    for name in cases:
        row = run(CASES[name], edge)
        log.info("%s: %s", name, row)
        verdicts.append(row.verdict)
        figures |= {
            f"{PREFIX}surface_mean_{name}": figure(row.mean, "mm"),
            f"{PREFIX}surface_max_{name}": figure(row.largest, "mm"),
            f"{PREFIX}dihedral_before_{name}": figure(row.dihedral_before, "deg"),
            f"{PREFIX}dihedral_{name}": figure(row.dihedral, "deg"),
            f"{PREFIX}said_{name}": {"value": "; ".join(row.said), "unit": "text"},
            f"{PREFIX}beyond_{name}": {"value": "; ".join(row.beyond), "unit": "text"},
            f"{PREFIX}verdict_{name}": {"value": row.verdict, "unit": "text"},
            f"{PREFIX}seconds_{name}": figure(row.seconds, "s"),
        }
    for verdict in (GOOD, NOTICED, MISSED, ALARM):
        figures[f"hard_cases_{verdict.replace(' ', '_')}"] = figure(float(verdicts.count(verdict)), "1")
    return figures


def run(case: Case, edge: float = EDGE) -> Row:
    """Fit a case and judge it; an error that is meant for people is one that is noticed."""
    scene = case.scene(edge)
    begun = time.process_time()
    try:
        fit = fit_organ(scene.mesh, Observed(scene.marks, scene.attachments), settings=scene.settings)
    except HandpipeError as error:
        seconds = time.process_time() - begun
        before = scene.mesh.smallest_dihedral()
        return Row(np.nan, np.nan, before, np.nan, [str(error)], ["no fit"], NOTICED, seconds)
    return judge(case, scene, fit, time.process_time() - begun)


def judge(case: Case, scene: Scene, fit: OrganFit, seconds: float) -> Row:
    """Compare a fit with the bars and with what is wrong in its input."""
    errors = surface_errors(fit.mesh, scene.truth)
    before, after = scene.mesh.smallest_dihedral(), fit.mesh.smallest_dihedral()
    bars = case.bars
    checks = [
        (errors.mean() <= bars.mean, f"mean above {bars.mean:g} mm"),
        (errors.max() <= bars.largest, f"largest above {bars.largest:g} mm"),
        (after >= bars.dihedral * before, f"smallest angle below {bars.dihedral:g} of the template's"),
        ((fit.mesh.volumes() > 0).all(), "inverted tets"),
    ]
    beyond = [text for met, text in checks if not met]
    said = doubts(fit)
    right = np.flatnonzero(fit.doubtful)
    named = np.array_equal(right, scene.wrong_attachments)
    return Row(
        mean=float(errors.mean()),
        largest=float(errors.max()),
        dihedral_before=before,
        dihedral=after,
        said=said,
        beyond=beyond,
        verdict=_verdict(bool(beyond), scene, said, named, bars.unsettled),
        seconds=seconds,
    )


def doubts(fit: OrganFit) -> list[str]:
    """What the fit says of its input."""
    quality = {name: value for name, (value, _) in fit.quality.items()}
    found = []
    if fit.doubtful.any():
        found.append(f"{fit.doubtful.sum()} attachments contradicted")
    if quality["marks_weight"] < 1:
        found.append(f"marks contradict each other by {quality['marks_scatter']:.2f} mm")
    if quality["marks_outlying"] > 0:
        found.append(f"{100 * quality['marks_outlying']:.0f} % of the marks far from the others")
    if quality["marks_left_out"] > 0:
        found.append(f"{quality['marks_left_out']:.0f} marks left out")
    return found


def _verdict(beyond: bool, scene: Scene, said: list[str], named: bool, unsettled: bool) -> str:
    """Good: within the bars, and attachments that are wrong are named, no others; where nobody can know the
    shape, a word must have been said. Beyond the bars: noticed if anything was said, else missed.
    """
    wrong = len(scene.wrong_attachments) + len(scene.wrong_marks) > 0
    if said and not wrong:
        return ALARM
    if beyond or not named or (unsettled and not said):
        return NOTICED if said else MISSED
    return GOOD


COLUMNS = ("case", "verdict", "surface mean, farthest [mm]", "bars [mm]", "smallest angle [deg]", "said", "s")


def table(figures: Mapping[str, Mapping[str, object]]) -> str:
    """The cases as Markdown."""
    names = [name for name in CASES if f"{PREFIX}verdict_{name}" in figures]
    verdicts = [str(figures[f"{PREFIX}verdict_{name}"]["value"]) for name in names]
    counts = ", ".join(f"{verdicts.count(v)} {v}" for v in (GOOD, NOTICED, MISSED, ALARM))
    lines = [f"{len(names)} cases: {counts}.", "", _line(COLUMNS), _line(["---"] * len(COLUMNS))]
    return "\n".join(lines + [_line(_cells(name, figures)) for name in names])


def _cells(name: str, figures: Mapping[str, Mapping[str, object]]) -> list[str]:
    def value(what: str) -> object:
        return figures[f"{PREFIX}{what}_{name}"]["value"]

    case, verdict, beyond = CASES[name], str(value("verdict")), str(value("beyond"))
    return [
        f"`{name}`: {case.what}",
        (f"**{verdict}**" if verdict in (MISSED, ALARM) else verdict) + (f": {beyond}" if beyond else ""),
        f"{value('surface_mean'):.2f}, {value('surface_max'):.2f}",
        f"{case.bars.mean:g}, {case.bars.largest:g}",
        f"{value('dihedral_before'):.2g} → {value('dihedral'):.2g}",
        str(value("said")),
        f"{value('seconds'):.0f}",
    ]


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"
