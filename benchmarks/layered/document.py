"""`python -m benchmarks.layered.document`: renew the tables of docs/hard-cases-simulation.md."""

from __future__ import annotations

import argparse
import re
import statistics
from collections.abc import Sequence
from pathlib import Path

from benchmarks.marked_parts import between
from handpipe.core import write_text

ROOT = Path(__file__).parents[2]
DOCUMENT = ROOT / "docs" / "hard-cases-simulation.md"
COMMAND = "python -m benchmarks.layered.document"
HEADS = (
    "case", "result", "checked against", "inverted", "least det F", "force left", "fat in bodies (mm)",
    "skin change, mean / largest (mm)", "seconds",
)  # fmt: skip
WRONG = "WRONG"
TEMPORARY = re.compile(r"\S*/(?=(?:damaged|broken|frames)\.)")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the tables of the parts that were measured."""
    parser = argparse.ArgumentParser(prog="benchmarks.layered.document", description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--document", type=Path, default=DOCUMENT, help="page whose tables are renewed")
    options = parser.parse_args(arguments)
    from benchmarks.layered.table import read

    text = options.document.read_text(encoding="utf-8")
    for part, make in (("cases", table), ("random", doubtful)):
        rows = read(options.results / "benchmarks" / "layered" / f"{part}.csv")
        if rows:
            text = between(text, part, COMMAND, make(list(rows.values())))
    write_text(options.document, text)


def table(rows: Sequence[dict[str, str]]) -> str:
    """The rows as a Markdown table, with how many there are of each verdict."""
    return "\n".join([f"{_counts(rows)}.", "", *_lines(rows)])


def doubtful(rows: Sequence[dict[str, str]]) -> str:
    """What holds of all rows, and a table of those that are wrong or say something."""
    seconds = [float(row["seconds"]) for row in rows]
    least = min(float(row["least_det"]) for row in rows if row["least_det"])
    inverted = sum(float(row["inverted"]) for row in rows)
    said = (
        f"{_counts(rows)}. {inverted:.0f} inverted tets, least det F {least:g}; "
        f"{statistics.median(seconds):.1f} s in the median, {max(seconds):.0f} s at most. "
        "Rows that are wrong or unsettled:"
    )
    return "\n".join([said, "", *_lines([row for row in rows if row["verdict"] == WRONG or row["said"]])])


def _counts(rows: Sequence[dict[str, str]]) -> str:
    verdicts = [row["verdict"] for row in rows]
    counts = ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(sorted(verdicts, reverse=True)))
    commits = ", ".join(dict.fromkeys(row["commit"][:8] or "no commit" for row in rows))
    return f"{len(rows)} rows: {counts}. Commit {commits}"


def _lines(rows: Sequence[dict[str, str]]) -> list[str]:
    lines = ["| " + " | ".join(HEADS) + " |", "|" + " --- |" * len(HEADS)]
    return lines + ["| " + " | ".join(c.replace("|", "/") for c in cells(row)) + " |" for row in rows]


def cells(row: dict[str, str]) -> list[str]:
    """A row as text."""
    result = f"**{WRONG}**: {row['faults']}" if row["verdict"] == WRONG else row["verdict"]
    if row["said"]:  # without folders of damaged files, which are temporary
        said = TEMPORARY.sub("", row["said"])
        result += f" ({said})"
    change = f"{row['skin_mean']} / {row['skin_max']}" if row["skin_mean"] else ""
    return [
        f"`{row['case']}`: {row['what']}",
        result,
        row["checks"],
        row["inverted"] if row["least_det"] else "",
        row["least_det"],
        row["unbalanced"],
        row["fat_in_bodies"],
        change,
        f"{float(row['seconds']):.1f}",
    ]


if __name__ == "__main__":
    main()
