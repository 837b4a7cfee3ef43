"""The figures of organs as Markdown tables between the markers of their documents, and drawings."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.shapes import hard_cases, speed_against_error
from handpipe.core import write_text

DOCS = Path(__file__).parents[2] / "docs"
PICTURE = DOCS / "figures" / "shapes-speed-against-error.png"


def write(source: Path) -> None:
    """Renew what has been measured; the rest of the documents stays."""
    figures = json.loads(source.read_text(encoding="utf-8"))
    if "hard_cases_good" in figures:
        renew(DOCS / "hard-cases-shapes.md", "hard_cases", hard_cases.table(figures))
    points = speed_against_error.points(figures)
    if points:
        renew(DOCS / "shapes.md", "speed_against_error", speed_against_error.table(points))
        speed_against_error.draw(points, PICTURE)


def renew(document: Path, part: str, content: str) -> None:
    """Put other content between the markers of a part; raises `ValueError` where they are missing."""
    begin, end = f"<!-- {part}: python -m benchmarks.shapes -->", f"<!-- end of {part} -->"
    before, found, rest = document.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"{document.name} lacks the markers {begin} and {end}")
    write_text(document, f"{before}{begin}\n\n{content}\n\n{end}{after}")
