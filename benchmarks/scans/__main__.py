"""`python -m benchmarks.scans PART --output FILE`: figures of one part.

`merge FILE…` puts parts together; `picture` draws the foot.

A part is a module of this package with `measure(results: Path) -> Metrics`.
"""

from __future__ import annotations

import argparse
import importlib
import logging
from collections.abc import Sequence
from pathlib import Path

from benchmarks.threads import take_threads

PARTS = ("foot", "knee", "skin", "alignment", "effects")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.scans", description=__doc__)
    parser.add_argument("part", choices=(*PARTS, "merge", "picture"))
    parser.add_argument("files", type=Path, nargs="*", help="of `merge`: the parts' figures")
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    take_threads(1)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    from benchmarks.trust.__main__ import merge
    from handpipe.core import metrics

    if options.part == "merge":
        merge(options.files, options.output)
        return
    if options.part == "picture":
        from benchmarks.scans.foot import Segmented, foot
        from benchmarks.scans.picture import draw

        volumes, seeds, labels = foot()
        draw([Segmented.of(volume, seeds, labels) for volume in volumes], list(labels), options.output)
        return
    metrics.write(
        options.output, importlib.import_module(f"benchmarks.scans.{options.part}").measure(options.results)
    )


if __name__ == "__main__":
    main()
