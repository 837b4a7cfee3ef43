"""Runs the hard cases and random poses, writes a row each, and gives their figures."""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from benchmarks.layered.case import Case, Outcome, Solved
from benchmarks.layered.cases import CASES
from benchmarks.layered.judging import REFUSED, RIGHT, WRONG, Row, judged
from benchmarks.layered.subject import Subject
from handpipe.core import Metrics, artifacts, write_text

log = logging.getLogger(__name__)

COLUMNS = (
    "case", "what", "verdict", "said", "faults", "unsettled", "inverted", "least_det", "unbalanced", "judged",
    "bones_outside", "twice", "fat_in_bodies", "muscles_in_bones", "skin_mean", "skin_max", "checks",
    "seconds", "commit",
)  # fmt: skip


def run_cases(subject: Subject, file: Path, only: Sequence[str] = ()) -> Metrics:
    """Rows of all cases, or of some in place of those in the file; each is kept as soon as it is made."""
    rows = read(file) if only else {}
    for name in only or CASES:
        rows[name] = cells(judged(CASES[name], subject))
        write(file, rows, list(CASES))
    return figures(rows)


def run_random(subject: Subject, file: Path, count: int, seed: int, resume: bool = False) -> Metrics:
    """Rows of random poses within the limits, and their figures; to resume keeps those of the same commit."""
    known, rows = read(file) if resume else {}, dict[str, dict[str, str]]()
    for number, angles in enumerate(islice(subject.random(seed), count)):
        frame = subject.frame(f"random {number}", angles)

        def run(subject: Subject, frame=frame) -> Outcome:  # type: ignore[no-untyped-def]
            return Outcome([Solved.of(frame, subject.whole())], same_pose=False)

        said = ", ".join(f"{n} {np.degrees(a):.0f}" for n, a in angles.items()) + " deg"
        row = known.get(frame.name, {})
        if (row.get("what"), row.get("commit")) != (said, artifacts.commit()):
            row = cells(judged(Case(frame.name, said, run), subject))
        rows[frame.name] = row
        write(file, rows, list(rows))
    seconds = [float(row["seconds"]) for row in rows.values()]
    refused = sum(row["verdict"] == REFUSED or "refused" in row["faults"] for row in rows.values())
    return {
        "random_poses": (float(len(rows)), "1"),
        "random_failed": (float(refused), "1"),
        "random_wrong": (float(sum(r["verdict"] == WRONG for r in rows.values()) - refused), "1"),
        "random_unsettled": (float(sum(float(r["unsettled"]) for r in rows.values())), "1"),
        "random_inverted": (float(sum(float(r["inverted"]) for r in rows.values())), "1"),
        "random_least_det": (min(float(r["least_det"]) for r in rows.values()), "1"),
        "random_frame_seconds_mean": (float(np.mean(seconds)), "s"),
        "random_frame_seconds_max": (float(np.max(seconds)), "s"),
    }


def figures(rows: dict[str, dict[str, str]]) -> Metrics:
    """How many cases there are of each verdict, and seconds and least det F of each case."""
    verdicts = [row["verdict"] for row in rows.values()]
    found: Metrics = {
        "cases": (float(len(rows)), "1"),
        "cases_right": (float(verdicts.count(RIGHT)), "1"),
        "cases_refused": (float(verdicts.count(REFUSED)), "1"),
        "cases_wrong": (float(verdicts.count(WRONG)), "1"),
        "cases_inverted_tets": (float(sum(float(r["inverted"]) for r in rows.values())), "1"),
    }
    for name, row in rows.items():
        stem = "case_" + name.replace("-", "_").replace(".", "_")
        found[f"{stem}_right"] = (float(row["verdict"] != WRONG), "1")
        found[f"{stem}_seconds"] = (float(row["seconds"]), "s")
        for column, unit in (("least_det", "1"), ("unbalanced", "1"), ("skin_max", "mm")):
            if row[column]:
                found[f"{stem}_{column}"] = (float(row[column]), unit)
    return found


def cells(row: Row) -> dict[str, str]:
    """A row as text, by column; empty where nothing was measured."""
    m = row.measures
    values: list[object] = [
        row.case, row.what, row.verdict, row.said, "; ".join(row.faults), m.unsettled, m.inverted,
        m.least_det if np.isfinite(m.least_det) else None, m.unbalanced, m.judged, m.bones_outside, m.twice,
        m.fat_in_bodies, m.muscles_in_bones, *(row.change or (None, None)), "; ".join(row.checks),
        row.seconds, artifacts.commit(),
    ]  # fmt: skip
    return {
        column: "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
        for column, value in zip(COLUMNS, values, strict=True)
    }


def write(file: Path, rows: dict[str, dict[str, str]], order: Sequence[str]) -> None:
    """Write rows as CSV, in the order of names."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows[name] for name in order if name in rows)
    write_text(file, text.getvalue())


def read(file: Path) -> dict[str, dict[str, str]]:
    """Rows by case; none where there is no file."""
    if not file.exists():
        return {}
    with open(file, encoding="utf-8", newline="") as stream:
        return {row["case"]: row for row in csv.DictReader(stream)}
