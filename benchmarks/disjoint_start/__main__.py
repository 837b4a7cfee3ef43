"""`python -m benchmarks.disjoint_start results/SUBJECT`: initial guesses of the separation.

Muscles are moved at random; counted are scenes without a guess, and measured the motion of vertices.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from benchmarks.threads import take_threads

OUTPUT = Path(__file__).parents[2] / "results" / "benchmarks" / "disjoint_start.json"


def main() -> None:
    """Part the shapes, one line each, and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.disjoint_start", description=__doc__)
    parser.add_argument("subject", type=Path, help="folder of results with rig.h5, registration/, muscles/")
    parser.add_argument("--count", type=int, default=4, help="draws a pose, the first of which is as it is")
    parser.add_argument("--size", type=float, default=0.4, help="mm, standard deviation of a component")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON of the figures")
    options = parser.parse_args()
    logging.basicConfig(level=logging.ERROR, format="%(message)s")
    take_threads(1)
    from benchmarks.disjoint_start.draws import figures, initial_guess, scenes, varied
    from handpipe.core import metrics

    results = []
    for pose, scene in scenes(options.subject):
        for seed in range(options.count):
            results.append(initial_guess(varied(scene, seed, options.size if seed else 0.0)))
            print(f"{pose}, draw {seed}: {results[-1]}", flush=True)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    metrics.write(options.output, figures(results))


if __name__ == "__main__":
    main()
