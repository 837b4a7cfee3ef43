"""`python -m benchmarks.trust PART --output FILE`: figures of one part; `merge FILE…` puts parts together.

A part is a module of this package with `measure(results: Path) -> Metrics`.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.parts import run_parts

if TYPE_CHECKING:
    from handpipe.core import Metrics

PARTS = ("solver", "frames", "seeds", "readers", "stale", "kills")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.trust", description=__doc__)
    run_parts(parser, PARTS, measure, arguments)


def measure(part: str, results: Path) -> Metrics:
    """Figures of a part, with its seconds and its memory."""
    from handpipe.core import metrics

    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        figures |= importlib.import_module(f"benchmarks.trust.{part}").measure(results)
    return {f"{part}_{k}" if k in ("seconds", "peak_memory") else k: v for k, v in figures.items()}


if __name__ == "__main__":
    main()
