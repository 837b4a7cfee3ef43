"""`python -m benchmarks.bones`: run the hard cases of the bones and the study of speed against error.

Writes results/benchmarks/bones.json and, with --document, the tables and the drawing of
docs/hard-cases-bones.md.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

log = logging.getLogger("benchmarks.bones")

CHECKOUT = Path(__file__).parents[2]
OUTPUT = CHECKOUT / "results" / "benchmarks" / "bones.json"
DOCUMENT = CHECKOUT / "docs" / "hard-cases-bones.md"
PICTURE = CHECKOUT / "docs" / "figures" / "speed-against-error-bones.png"
PARTS = ("hard_cases", "speed_against_error")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts or cases asked for; what was not run is kept from the file."""
    if "numba" not in sys.modules:  # the libraries read the number of threads when they are loaded
        for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
            os.environ[name] = "1"
    options = _options(arguments)
    from benchmarks.bones import document, hard_cases, speed_against_error
    from benchmarks.bones.cases import CASES
    from benchmarks.bones.subject import INDEX, SMALL
    from handpipe.artifacts import write_text

    found = json.loads(options.output.read_text(encoding="utf-8")) if options.output.exists() else {}
    rows = {row["case"]: hard_cases.Row(**row) for row in found.get("hard_cases", [])}
    points = [speed_against_error.Point(**p) for p in found.get("speed_against_error", [])]
    for name in CASES if "hard_cases" in options.what else [n for n in CASES if n in options.what]:
        rows[name] = hard_cases.measure(name, SMALL if options.quick else INDEX)
    if "speed_against_error" in options.what:
        measure = speed_against_error.measure
        points = measure((0.8, 1.2), (1e-2,), (7.0,), SMALL) if options.quick else measure()
    listed = [rows[name] for name in CASES if name in rows]
    content = {
        "hard_cases": [asdict(row) for row in listed],
        "speed_against_error": [asdict(p) for p in points],
    }
    write_text(options.output, json.dumps(content, indent=1) + "\n")
    print(hard_cases.table(listed))
    if options.document:
        document.write(listed, points, DOCUMENT, PICTURE)


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
    logging.basicConfig(level=logging.ERROR, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    logging.getLogger("benchmarks").setLevel(logging.INFO)
    main()
