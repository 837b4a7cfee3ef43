"""Command line of a benchmark's document: a picture, and a table beside it, of merged figures."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from handpipe.core import Metrics, artifacts, metrics


def write_document(
    parser: argparse.ArgumentParser,
    picture: Callable[[Metrics], Figure],
    table: Callable[[Metrics], str],
    arguments: Sequence[str] | None = None,
) -> None:
    """Draw the picture and write the table of a file of figures."""
    parser.add_argument("figures", type=Path, help="JSON of all parts")
    parser.add_argument("--output", type=Path, required=True, help="PNG to be written")
    options = parser.parse_args(arguments)
    found = metrics.read(options.figures)
    FigureCanvasAgg(picture(found)).print_figure(options.output, dpi=110)
    artifacts.write_text(options.output.with_suffix(".md"), table(found))
