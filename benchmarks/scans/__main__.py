"""`python -m benchmarks.scans PART --output FILE`: figures of one part; `merge FILE…` puts parts together.

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

PARTS = ("foot", "knee", "skin", "alignment", "effects", "chain", "from_raw")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.scans", description=__doc__)
    run_parts(parser, PARTS, measure, arguments)


def measure(part: str, results: Path) -> Metrics:
    """Figures of a part."""
    found: Metrics = importlib.import_module(f"benchmarks.scans.{part}").measure(results)
    return found


if __name__ == "__main__":
    main()
