"""`python -m benchmarks.frames results/SUBJECT`: its muscles in random poses between the scanned ones.

How many come to rest, after how many renewals of contact and how many seconds.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from benchmarks.threads import take_threads

OUTPUT = Path(__file__).parents[2] / "results" / "benchmarks" / "frames.json"


def main() -> None:
    """Simulate the poses, one line each, and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.frames", description=__doc__)
    parser.add_argument("subject", type=Path, help="folder of results with rig.h5 and muscles/")
    parser.add_argument("--count", type=int, default=20, help="poses")
    parser.add_argument("--seed", type=int, default=0, help="of their choice")
    parser.add_argument(
        "--reach", type=float, default=1.0, help="times the mixture; above 1 beyond the scans"
    )
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON of the figures")
    options = parser.parse_args()
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    take_threads(1)
    from benchmarks.frames.mixtures import mixtures
    from benchmarks.frames.muscles import figures, simulated
    from handpipe.core import metrics
    from handpipe.skeleton.rig import Rig

    rig = Rig.load(options.subject / "rig.h5")
    scanned = {name: pose.angles for name, pose in rig.poses.items()}
    poses = mixtures(scanned, options.count, options.seed, options.reach)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    metrics.write(options.output, figures(simulated(options.subject, rig, poses)))


if __name__ == "__main__":
    main()
