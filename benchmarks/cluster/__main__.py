"""`python -m benchmarks.cluster --output JSON`: measured jobs on 1 to 1,000 workers, simulated.

A table is written beside the figures, with the ending .md, and a picture, with the ending .svg.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_svg import FigureCanvasSVG

from benchmarks.cluster.cases import cases, figures
from benchmarks.cluster.document import picture, table
from benchmarks.cluster.groups import Groups
from benchmarks.cluster.measured import KEPT, Measured
from benchmarks.cluster.schedule import Costs
from handpipe.core import Metrics, artifacts, metrics

PROFILE = Path(__file__).parents[2] / "profiles" / "slurm"
OUTPUT = Path("results/benchmarks/cluster.json")
COSTS = Costs(start=11.0, notice=30.0)  # s; docs/how-to/cluster.md says how they were measured


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate, print the table, write it, the figures and the picture."""
    parser = argparse.ArgumentParser(prog="benchmarks.cluster", description=__doc__)
    parser.add_argument("--measured", type=Path, default=KEPT, help="JSON of lengths")
    parser.add_argument("--profile", type=Path, default=PROFILE, help="folder of the profile with groups")
    parser.add_argument("--start", type=float, default=COSTS.start, help="s of a worker before each job")
    parser.add_argument("--notice", type=float, default=COSTS.notice, help="s from a job's end to the next")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON of the figures")
    options = parser.parse_args(arguments)
    costs = Costs(options.start, options.notice)
    found: Metrics = {"start": (costs.start, "s"), "notice": (costs.notice, "s")}
    shown = cases(Measured.read(options.measured), Groups.read(options.profile))
    for case in shown:
        found |= figures(case, costs)
    texts = {case.name: case.text for case in shown}
    options.output.parent.mkdir(parents=True, exist_ok=True)
    metrics.write(options.output, found)
    artifacts.write_text(options.output.with_suffix(".md"), table(found, texts))
    FigureCanvasSVG(picture(found, texts)).print_svg(
        options.output.with_suffix(".svg"), metadata={"Date": None}
    )
    print(table(found, texts))


if __name__ == "__main__":
    main()
