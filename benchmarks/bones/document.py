"""Tables and drawings of docs/hard-cases-bones.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.bones.hard_cases import Pair, Row, table
from benchmarks.bones.speed_against_error import SWEPT, Point
from benchmarks.marked_parts import between
from handpipe.core import atomic, write_text

COMMAND = "python -m benchmarks.bones"
UNITS = {"voxel size": "mm", "tolerance": "of the probability"} | {
    name: unit for name, (unit, _) in SWEPT.items()
}


def write(rows: Sequence[Row], points: Sequence[Point], document: Path, picture: Path) -> None:
    """Renew what has been measured, between its markers; the rest of the document stays."""
    text = document.read_text(encoding="utf-8")
    if rows:
        text = between(text, "hard_cases", COMMAND, f"{table(rows)}\n\n{words(rows)}")
    if points:
        text = between(text, "speed_against_error", COMMAND, speed_table(points))
        draw(points, picture)
    write_text(document, text)


def words(rows: Sequence[Row]) -> str:
    """What went wrong in each case, and what the library said, as a list."""
    lines = ["What was wrong, and what was said of it:", ""]
    for row in rows:
        quiet = "its own uncertainty covers it" if row.noticed == len(row.wrong) else "nothing said"
        if row.wrong or row.said:
            wrong = "; ".join(row.wrong) or "nothing wrong"
            said = "; ".join(row.said[:3]) + ("; …" if len(row.said) > 3 else "") or quiet
            lines.append(f"- `{row.case}`: {wrong}. *{said}.*")
    return "\n".join(lines)


def speed_table(points: Sequence[Point]) -> str:
    """The settings as a Markdown table."""
    heads = (
        "setting", "Dice mean / min", "registration", "rig, left-out poses", "bones left out",
        "seconds a pose",
    )  # fmt: skip
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for p in points:
        dice = "" if p.dice is None else f"{p.dice[0]:.3f} / {p.dice[1]:.3f}"
        row = (
            f"{p.study} {p.at:g} {UNITS[p.study]}", dice, _pair(p.registration), _pair(p.rig), str(p.missed),
            f"{p.seconds / p.poses:.1f}",
        )  # fmt: skip
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines)


def _pair(values: Pair | None) -> str:
    return "" if values is None else f"{values[0]:.3f} deg, {values[1]:.3f} mm"


def draw(points: Sequence[Point], path: Path) -> None:
    """Errors over seconds, a curve for each study; voxel sizes are written beside their points."""
    panels = {
        "1 - mean Dice": lambda p: None if p.dice is None else 1 - p.dice[0],
        "registration [deg]": lambda p: p.registration and p.registration[0],
        "rig, left-out poses [deg]": lambda p: p.rig and p.rig[0],
    }
    figure = Figure(figsize=(10.0, 3.6), layout="constrained")
    for axes, (name, value) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
        for study, marker in zip(dict.fromkeys(p.study for p in points), "osD^v", strict=False):
            shown = [(p.seconds / p.poses, value(p), p.at) for p in points if p.study == study and value(p)]
            axes.loglog(*zip(*[s[:2] for s in shown], strict=True), marker=marker, markersize=4, label=study)
            for x, y, at in shown if study == "voxel size" else ():  # the others lie on one another
                axes.annotate(f"{at:g}", (x, y), fontsize=6, xytext=(3, 3), textcoords="offset points")
        axes.set_xlabel("seconds a pose")
        axes.set_title(name, fontsize=10)
        axes.grid(True, which="major", linewidth=0.4)
    axes.legend(fontsize=8)
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=90)
