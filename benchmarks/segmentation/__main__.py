"""`python -m benchmarks.segmentation DATASET`: write results/benchmarks/segmentation.json."""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.threads import take_threads
from handpipe.core import artifacts

log = logging.getLogger("benchmarks.segmentation")

CHECKOUT = Path(__file__).parents[2]
OUTPUT = CHECKOUT / "results" / "benchmarks" / "segmentation.json"
BONES = ("metacarpal1", "proximal2", "metacarpal3", "middle4", "distal5", "capitate")
POSES = ("neutral", "fist")


def main(arguments: Sequence[str] | None = None) -> None:
    """Both walkers in every region asked for, on one thread: the project's walker uses no more."""
    options = _options(arguments)
    take_threads(1)
    from benchmarks.segmentation import comparison
    from handpipe.core.configuration import load_dataset

    dataset = load_dataset(options.dataset)
    figures = comparison.measure(dataset, options.poses, options.bones, options.repeats)
    artifacts.write_text(options.output, json.dumps(dict(sorted(figures.items())), indent=1) + "\n")


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.segmentation", description=__doc__)
    parser.add_argument("dataset", type=Path, help="dataset file of a subject with seeds and truth")
    parser.add_argument("--bones", nargs="+", default=BONES)
    parser.add_argument("--poses", nargs="+", default=POSES)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    logging.getLogger("benchmarks").setLevel(logging.INFO)
    main()
