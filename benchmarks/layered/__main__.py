"""`python -m benchmarks.layered PART --output FILE`: hard cases of a built finger, layer on layer.

Parts are `cases` and `random`; `merge FILE…` puts their figures together. Each part also writes a row a case
or pose into `benchmarks/layered/` of the folder of results, of which `benchmarks.layered.document` makes
tables.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.parts import run_parts

if TYPE_CHECKING:
    from handpipe.core import Metrics

PARTS = ("cases", "random")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.layered", description=__doc__)
    parser.add_argument("--only", nargs="+", default=[], help="of `cases`: names; others keep their rows")
    parser.add_argument("--count", type=int, default=20, help="of `random`: poses")
    parser.add_argument("--seed", type=int, default=0, help="of `random`: of their choice")
    parser.add_argument("--resume", action="store_true", help="of `random`: keep poses that this commit made")
    options, _ = parser.parse_known_args(arguments)

    def measure(part: str, results: Path) -> Metrics:
        logging.getLogger("handpipe").setLevel(logging.WARNING)
        from benchmarks.layered import table
        from benchmarks.layered.subject import finger
        from handpipe.core import metrics

        figures: metrics.Metrics = {}
        with metrics.measured(figures):
            subject, folder = finger(results), results / "benchmarks" / "layered"
            if part == "cases":
                figures |= table.run_cases(subject, folder / "cases.csv", options.only)
            else:
                file = folder / "random.csv"
                figures |= table.run_random(subject, file, options.count, options.seed, options.resume)
        return {f"{part}_{k}" if k in ("seconds", "peak_memory") else k: v for k, v in figures.items()}

    run_parts(parser, PARTS, measure, arguments)


if __name__ == "__main__":
    main()
