"""`python -m benchmarks.fidelity PART --output FILE`: the finger at one fidelity; `merge` joins parts."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from benchmarks.fidelity.chain import POINTS, measure
from benchmarks.parts import run_parts


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure one part, or merge."""
    parser = argparse.ArgumentParser(prog="benchmarks.fidelity", description=__doc__)
    run_parts(parser, tuple(POINTS), measure, arguments)


if __name__ == "__main__":
    main()
