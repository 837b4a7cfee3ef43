"""`python -m benchmarks.fidelity.document FIGURES --output PNG`: the chain's speed against its error.

A table of the same figures is written beside the picture, with the ending .md.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.documents import write_document
from benchmarks.fidelity.chain import POINTS
from handpipe.core import Metrics

SECONDS = "frame_seconds_mean"
SHOWN = {
    "skin_true_heldout_error_mean": "skin",
    "muscles_heldout_surface_error_mean": "muscles",
    "tendons_heldout_centreline_error_mean": "tendons",
}


def table(found: Metrics) -> str:
    """Rows of the points that were measured: seconds a frame and errors on held-out poses."""
    names = [SECONDS, "frame_seconds_max", *SHOWN]
    heads = ["s a frame, mean", "most", *(f"{body}, mm" for body in SHOWN.values())]
    lines = [f"| fidelity | {' | '.join(heads)} |", "| --- " * (len(heads) + 1) + "|"]
    for point in POINTS:
        cells = [found.get(f"{point}_{name}") for name in names]
        if any(cells):
            lines.append(f"| {point} | {' | '.join(f'{c[0]:.3g}' if c else '' for c in cells)} |")
    return "\n".join(lines) + "\n"


def picture(found: Metrics) -> Figure:
    """Errors on held-out poses over the seconds of a frame, one line a body, one mark a fidelity."""
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    for name, body in SHOWN.items():
        known = [p for p in POINTS if f"{p}_{name}" in found and f"{p}_{SECONDS}" in found]
        places = sorted((found[f"{p}_{SECONDS}"][0], found[f"{p}_{name}"][0], p) for p in known)
        axes.plot([s for s, _, _ in places], [e for _, e, _ in places], "o-", label=body)
        for seconds, error, point in places:
            axes.annotate(point, (seconds, error), xytext=(3, 4), textcoords="offset points", fontsize=8)
    axes.set(xscale="log", xlabel="seconds a frame, mean", ylabel="mean error of held-out poses in mm")
    axes.set_ylim(bottom=0)
    axes.legend()
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the picture and write the table."""
    parser = argparse.ArgumentParser(prog="benchmarks.fidelity.document", description=__doc__)
    write_document(parser, picture, table, arguments)


if __name__ == "__main__":
    main()
