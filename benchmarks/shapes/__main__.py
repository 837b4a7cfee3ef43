"""`python -m benchmarks.shapes`: shapes from plastic strains, measured for results/benchmarks/shapes.json."""

from __future__ import annotations

import argparse
import importlib
import json
import logging
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.threads import take_threads
from handpipe.core import artifacts

log = logging.getLogger("benchmarks.shapes")

OUTPUT = Path(__file__).parents[2] / "results" / "benchmarks" / "shapes.json"
THREADS = 2
PARTS = (
    "string", "known_strains", "solves", "organs", "separation", "seventeen", "comparisons", "standard",
    "density", "plots", "hard_cases", "speed_against_error",
)  # fmt: skip
QUICK: dict[str, dict[str, object]] = {
    "string": {"cells": 16, "picture": None},
    "known_strains": {"edges": (3.2,), "counts": (60,)},
    "solves": {"edge": 2.6, "rows": 300, "patience": 1000.0},
    "organs": {"edge": 2.8, "liver_edge": 18.0, "many": 500},
    "separation": {"turns": (0.0,), "overlaps": ()},
    "seventeen": {"count": 2, "edge": 2.0, "muscles": 3},
    "comparisons": {"refinements": 0, "picture": None},
    "standard": {
        "bodies": ("twist",),
        "methods": ("arap_volume", "bending", "primo", "elastic"),
        "image": None,
    },
    "density": {"counts": (4, 16), "refinement": 0, "image": None},
    "plots": {"edge": 4.0, "liver_edge": 30.0, "image": None},
    "hard_cases": {"edge": 4.0, "cases": ("plain", "attachment-off-8")},
    "speed_against_error": {
        "edges": (4.0, 3.2),
        "marks": (50,),
        "enough": (0.1,),
        "progress": (0.1,),
        "fine": 2.5,
    },
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts asked for; figures of parts that were not run are kept from the file."""
    options = _options(arguments)
    if len(options.parts) == 1:
        _measure(options.parts[0], options)
    else:
        for part in options.parts:
            _measure_alone(part, options)
    if options.document:
        from benchmarks.shapes import document

        document.write(options.output)


def _measure_alone(part: str, options: argparse.Namespace) -> None:
    """A part in a process of its own, so that its peak of memory is its own."""
    command = [sys.executable, "-m", "benchmarks.shapes", part]
    command += ["--output", str(options.output), "--threads", str(options.threads)]
    subprocess.run(command + ["--quick"] * options.quick, check=True)


def _measure(part: str, options: argparse.Namespace) -> None:
    take_threads(options.threads)
    from benchmarks.fem import machine

    figures: dict[str, object] = {}
    if options.output.exists():
        figures = json.loads(options.output.read_text(encoding="utf-8"))
    begun = time.perf_counter()
    log.info("%s", part)
    measure = importlib.import_module(f"benchmarks.shapes.{part}").measure
    figures |= measure(**(QUICK.get(part, {}) if options.quick else {}))
    figures[f"{part}_wall_seconds"] = machine.figure(time.perf_counter() - begun, "s")
    figures |= machine.facts()
    artifacts.write_text(options.output, json.dumps(dict(sorted(figures.items())), indent=1) + "\n")


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.shapes", description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; by default all")
    parser.add_argument("--quick", action="store_true", help="small sizes: does it run, not how fast")
    parser.add_argument("--document", action="store_true", help="renew the tables of the documents")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--threads", type=int, default=THREADS)
    options = parser.parse_args(arguments)
    options.parts = options.parts or (() if options.document else PARTS)
    unknown = set(options.parts) - set(PARTS)
    if unknown:
        parser.error(f"unknown parts: {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    return options


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    for name in ("benchmarks", "handpipe.shapes"):
        logging.getLogger(name).setLevel(logging.INFO)
    main()
