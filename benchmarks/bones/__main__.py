"""`python -m benchmarks.bones`: run the hard cases of the bones and the study of speed against error.

Writes results/benchmarks/bones.json and, with --document, the tables and the drawing of
docs/hard-cases-bones.md.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.threads import take_threads

if TYPE_CHECKING:  # loading them loads numba, which reads its number of threads then
    from benchmarks.bones.hard_cases import Row
    from benchmarks.bones.speed_against_error import Point

log = logging.getLogger("benchmarks.bones")

CHECKOUT = Path(__file__).parents[2]
OUTPUT = CHECKOUT / "results" / "benchmarks" / "bones.json"
DOCUMENT = CHECKOUT / "docs" / "hard-cases-bones.md"
PICTURE = CHECKOUT / "docs" / "figures" / "speed-against-error-bones.png"
PARTS = ("hard_cases", "speed_against_error")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts or cases asked for; what was not run is kept from the file."""
    take_threads(1)
    options = _options(arguments)
    from benchmarks.bones import document, hard_cases, speed_against_error
    from benchmarks.bones.cases import CASES
    from benchmarks.bones.subject import PHALANGES, SMALL

    found = json.loads(options.output.read_text(encoding="utf-8")) if options.output.exists() else {}
    rows = {row["case"]: hard_cases.Row(**row) for row in found.get("hard_cases", [])}
    points = [speed_against_error.Point(**p) for p in found.get("speed_against_error", [])]
    for name in CASES if "hard_cases" in options.what else [n for n in options.what if n in CASES]:
        rows[name] = hard_cases.measure(name, SMALL if options.quick else PHALANGES)
        _save(options.output, rows.values(), points)
    if "speed_against_error" in options.what:
        measure, points = speed_against_error.measure, []
        for point in measure((0.8, 1.2), (1e-2,), {"margin": (7.0,)}, SMALL) if options.quick else measure():
            points.append(point)
            _save(options.output, rows.values(), points)
    listed = [rows[name] for name in CASES if name in rows]
    print(hard_cases.table(listed))
    if options.document:
        document.write(listed, points, DOCUMENT, PICTURE)


def _save(path: Path, rows: Iterable[Row], points: Iterable[Point]) -> None:
    """Written after each row and point: a benchmark that is stopped keeps what it has measured."""
    from handpipe.core import write_text

    content = {
        "hard_cases": [asdict(row) for row in rows],
        "speed_against_error": [asdict(point) for point in points],
    }
    write_text(path, json.dumps(content, indent=1) + "\n")


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    from benchmarks.bones.cases import CASES

    parser = argparse.ArgumentParser(prog="python -m benchmarks.bones", description=__doc__)
    parser.add_argument("what", nargs="*", help=f"parts ({', '.join(PARTS)}) or cases; by default all parts")
    parser.add_argument("--quick", action="store_true", help="two small bones in three poses: does it run")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--document", action="store_true", help=f"renew the tables of {DOCUMENT.name}")
    options = parser.parse_args(arguments)
    unknown = set(options.what) - set(PARTS) - set(CASES)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join((*PARTS, *CASES))}")
    if not options.what and not options.document:
        options.what = list(PARTS)
    return options


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    logging.getLogger("benchmarks").setLevel(logging.INFO)
    main()
