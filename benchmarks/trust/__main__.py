"""`python -m benchmarks.trust PART --output FILE`: figures of one part; `merge FILE…` puts parts together.

A part is a module of this package with `measure(results: Path) -> Metrics`.
"""

from __future__ import annotations

import argparse
import importlib
import logging
from collections.abc import Sequence
from pathlib import Path

from benchmarks.threads import take_threads

PARTS = ("solver", "frames", "seeds", "readers", "stale", "kills")


def merge(files: Sequence[Path], output: Path) -> None:
    """One file of all parts' figures; each figure has one part."""
    from handpipe.core import metrics

    merged: metrics.Metrics = {}
    for file in files:
        found = metrics.read(file)
        twice = merged.keys() & found.keys()
        if twice:
            raise ValueError(f"{file}: {', '.join(sorted(twice))}: another part has a figure of this name")
        merged |= found
    metrics.write(output, merged)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.trust", description=__doc__)
    parser.add_argument("part", choices=(*PARTS, "merge"))
    parser.add_argument("files", type=Path, nargs="*", help="of `merge`: the parts' figures")
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    take_threads(1)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    if options.part == "merge":
        merge(options.files, options.output)
        return
    from handpipe.core import metrics

    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        figures |= importlib.import_module(f"benchmarks.trust.{options.part}").measure(options.results)
    metrics.write(
        options.output,
        {f"{options.part}_{k}" if k in ("seconds", "peak_memory") else k: v for k, v in figures.items()},
    )


if __name__ == "__main__":
    main()
