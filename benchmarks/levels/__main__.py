"""`python -m benchmarks.levels PART --output FILE`: levels of a built subject; `merge` joins parts.

The parts `finger` and `hand` read the frames of their subject's scene of random poses, learn from the first
four fifths, and test on the others. The part `creases` simulates the finger's scanned poses at level L3.
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

PARTS = ("finger", "hand", "creases")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.levels", description=__doc__)

    def measure(part: str, results: Path) -> Metrics:
        logging.getLogger("handpipe").setLevel(logging.WARNING)
        from benchmarks.levels.contractions import example
        from benchmarks.levels.creases import creases
        from benchmarks.levels.measured import measured
        from benchmarks.levels.springs import springs
        from benchmarks.levels.subject import Subject
        from benchmarks.levels.truth import against_truth
        from handpipe.core import metrics

        figures: metrics.Metrics = {}
        if part == "creases":
            with metrics.measured(figures):
                found = creases(results)
            return {f"{part}_{name}": value for name, value in (found | figures).items()}
        with metrics.measured(figures):
            subject = Subject.built(part, results)
            found = measured(subject) | springs(subject) | against_truth(subject)
        named = {f"{part}_{name}": value for name, value in (found | figures).items()}
        if part == "hand":  # the limits of the ladder are those of the whole hand
            named |= example(subject)
            limits = {"l0": "skin", "l1": "everything", "l2": "everything"}
            named |= {f"{level}_seconds": found[f"{level}_{what}_seconds"] for level, what in limits.items()}
        return named

    run_parts(parser, PARTS, measure, arguments)


if __name__ == "__main__":
    main()
