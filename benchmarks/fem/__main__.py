"""`python -m benchmarks.fem`: measure everything and write results/benchmarks/fem.json."""

from __future__ import annotations

import argparse
import importlib
import json
import logging
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.threads import take_threads
from handpipe.core import artifacts, metrics

log = logging.getLogger("benchmarks.fem")

CHECKOUT = Path(__file__).parents[2]
OUTPUT = CHECKOUT / "results" / "benchmarks" / "fem.json"
DOCUMENT = CHECKOUT / "docs" / "benchmarks.md"
THREADS = 2
PARTS = ("assembly", "linear", "hard_cases", "twist", "scaling", "fat", "speed_against_error")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts asked for; figures of parts that were not run are kept from the file."""
    options = _options(arguments)
    take_threads(options.threads)
    from benchmarks.fem import machine

    figures = dict(_known(options.output))
    for part in options.parts:
        begun = time.perf_counter()
        log.info("%s", part)
        figures |= measured(part, options.quick, options.output.parent)
        figures[f"{part}_wall_seconds"] = machine.figure(time.perf_counter() - begun, "s")
        figures |= machine.facts()
        # Written after each part: a benchmark that is stopped keeps what it has measured.
        artifacts.write_text(options.output, json.dumps(dict(sorted(figures.items())), indent=1) + "\n")
    from benchmarks.fem import document

    document.draw(metrics.read(options.output), options.output.parent)
    if options.document:
        document.write(options.output, DOCUMENT, DOCUMENT.parent / "figures")


def measured(part: str, quick: bool, folder: Path) -> dict[str, object]:
    """The figures of one part; one that does not measure here has none."""
    measure: Callable[..., dict[str, object]] | None
    measure = getattr(importlib.import_module(f"benchmarks.fem.{part}"), "measure", None)
    if measure is None:
        log.warning("%s has no figures of its own", part)
        return {}
    settings = QUICK.get(part, {}) if quick else {}
    if part == "fat":
        settings = {"cache": folder / ("thin-body-quick.h5" if quick else "thin-body.h5"), **settings}
    return measure(**settings)


QUICK: dict[str, dict[str, object]] = {
    "linear": {"cells": (3, 4), "large": 4},
    "twist": {"sizes": {"1k": 3}, "repeats": 1},
    "scaling": {"cells": (4, 5, 6), "repeats": 1},
    "fat": {"scale": 3.0, "repeats": 1},
    "speed_against_error": {"sizes": (2, 4), "truth": 6, "solver_size": 4, "repeats": 1},
}


def _known(path: Path) -> dict[str, object]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fem", description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; by default all")
    parser.add_argument("--quick", action="store_true", help="small sizes: does it run, not how fast")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--document", action="store_true", help=f"renew the tables of {DOCUMENT.name}")
    parser.add_argument("--threads", type=int, default=THREADS)
    options = parser.parse_args(arguments)
    if not options.parts and not options.document:
        options.parts = PARTS
    unknown = set(options.parts) - set(PARTS)
    if unknown:
        parser.error(f"unknown parts: {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    return options


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    logging.getLogger("benchmarks").setLevel(logging.INFO)
    main()
