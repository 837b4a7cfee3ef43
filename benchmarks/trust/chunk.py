"""`python -m benchmarks.trust.chunk CHUNK --output FILE`: solve some of the benchmark's frames."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path

from benchmarks.threads import take_threads


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve the frames of one chunk and write what came of them."""
    parser = argparse.ArgumentParser(prog="benchmarks.trust.chunk", description=__doc__)
    parser.add_argument("chunk", help="inside, outside or path, and a number: outside2")
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--output", type=Path, required=True, help="NumPy archive")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    take_threads(1)
    from benchmarks.trust.frames import solved

    solved(options.chunk, options.results).write(options.output)


if __name__ == "__main__":
    main()
