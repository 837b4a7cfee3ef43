"""Write results/benchmarks/anatomy.json: `python -m benchmarks.anatomy FOLDER`, where real anatomy lies."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.threads import take_threads

log = logging.getLogger("benchmarks.anatomy")

OUTPUT = Path(__file__).parents[2] / "results" / "benchmarks" / "anatomy.json"


def main(arguments: Sequence[str] | None = None) -> None:
    """Envelopes, edits, and warps where the real anatomy is at hand, on one thread."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.anatomy", description=__doc__)
    parser.add_argument("folder", type=Path, help="real anatomy; where it is absent warps are left out")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args(arguments)
    take_threads(1)
    from benchmarks.anatomy import edits, envelopes, warps
    from handpipe.core import metrics

    figures = envelopes.measure() | edits.measure()
    if options.folder.exists():
        figures |= warps.measure(options.folder)
    else:
        log.warning("%s is absent: no figures of warps", options.folder)
    metrics.write(options.output, figures)


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    main()
