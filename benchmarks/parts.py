"""Command line of a benchmark in parts: one part is measured, or the figures of all are merged."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.threads import take_threads

if TYPE_CHECKING:  # loading it loads numba, which reads its number of threads then
    from handpipe.core import Metrics


def run_parts(
    parser: argparse.ArgumentParser,
    parts: Sequence[str],
    measure: Callable[[str, Path], Metrics],
    arguments: Sequence[str] | None = None,
) -> None:
    """Write what `measure` returns for a part and the folder of built subjects, or merge files of figures."""
    parser.add_argument("part", choices=(*parts, "merge"))
    parser.add_argument("files", type=Path, nargs="*", help="of `merge`: the parts' figures")
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    take_threads(1)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    from handpipe.core import metrics

    found = merged(options.files) if options.part == "merge" else measure(options.part, options.results)
    metrics.write(options.output, found)


def merged(files: Sequence[Path]) -> Metrics:
    """All parts' figures; each figure has one part."""
    from handpipe.core import metrics

    together: metrics.Metrics = {}
    for file in files:
        found = metrics.read(file)
        twice = together.keys() & found.keys()
        if twice:
            raise ValueError(f"{file}: {', '.join(sorted(twice))}: another part has a figure of this name")
        together |= found
    return together
