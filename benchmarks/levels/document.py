"""`python -m benchmarks.levels.document FIGURES --output PNG`: error against seconds a frame.

A table of the same figures is written beside the picture, with the ending .md.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.documents import write_document
from handpipe.core import Metrics

PARTS = ("finger", "hand")
TISSUES = ("skin", "muscles", "tendons_surface", "tendons", "ligaments")
NAMES = {"tendons_surface": "tendons, to the surface", "tendons": "tendons, by vertex"}
LEVELS = ("l0", "l1")  # learned
EVERY = (*LEVELS, "l2")
MARKS = {"finger": "o", "hand": "s"}


def table(found: Metrics) -> str:
    """A row for each subject and level: seconds, mean and largest error of each tissue."""
    heads = [NAMES.get(tissue, tissue) for tissue in TISSUES]
    lines = [
        f"| subject, level | ms a frame: skin; organs; with bones | {' | '.join(heads)} |",
        "| --- " * (len(TISSUES) + 2) + "|",
    ]
    for part in PARTS:
        for level in EVERY:
            lines += [_row(found, part, level)] if f"{part}_{level}_skin_seconds" in found else []
    return "\n".join(lines) + "\n"


def _row(found: Metrics, part: str, level: str) -> str:
    seconds = [found[f"{part}_{level}_{what}_seconds"][0] for what in ("skin", "organs", "everything")]
    errors = [_error(found, f"{part}_{level}_{tissue}") for tissue in TISSUES]
    cells = ["; ".join(f"{1e3 * s:.2f}" for s in seconds), *errors]
    return f"| {part}, {level.upper()} | {' | '.join(cells)} |"


def _error(found: Metrics, name: str) -> str:
    """Mean and largest error; nothing for a tissue that the level does not have."""
    if f"{name}_error_mean" not in found:
        return ""
    mean, largest = (found[f"{name}_error_{kind}"][0] for kind in ("mean", "max"))
    return f"{mean:.3f}; {largest:.1f}"


def picture(found: Metrics) -> Figure:
    """Errors over seconds of a frame, and over the number of frames that L1 is learned from."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for part in PARTS:
        if f"{part}_l0_skin_seconds" in found:
            _against_seconds(left, found, part)
            _against_frames(right, found, part)
    left.set(xscale="log", xlabel="seconds a frame", ylabel="mean error on left-out poses in mm")
    left.set_yscale("symlog", linthresh=0.05)
    left.set_ylim(0, 3)
    right.set(xlabel="simulated frames, of which a fifth is for the bounds", ylabel="mean error of L1 in mm")
    right.set_yscale("log")
    for axes in (left, right):
        if axes.has_data():
            axes.legend(fontsize=7)
    return figure


def _against_seconds(axes: Axes, found: Metrics, part: str) -> None:
    """L0, L1 and the simulation at preview, which the errors are of."""
    seconds = [found[f"{part}_{level}_organs_seconds"][0] for level in LEVELS]
    seconds.append(found[f"{part}_simulated_seconds"][0])
    for number, tissue in enumerate(TISSUES[:3]):
        errors = [found[f"{part}_{level}_{tissue}_error_mean"][0] for level in LEVELS] + [0.0]
        axes.plot(
            seconds,
            errors,
            MARKS[part] + "-",
            color=f"C{number}",
            label=f"{part}: {NAMES.get(tissue, tissue)}",
        )
        if number == 0:
            for second, error, name in zip(seconds, errors, ("L0", "L1", "preview"), strict=True):
                place = (-8, 6) if part == "finger" else (5, 6)
                axes.annotate(name, (second, error), xytext=place, textcoords="offset points", fontsize=8)
        if f"{part}_l2_{tissue}_error_mean" in found:
            second = found[f"{part}_l2_organs_seconds"][0]
            error = found[f"{part}_l2_{tissue}_error_mean"][0]
            axes.plot(second, error, MARKS[part], color=f"C{number}", mfc="none")
            axes.annotate("L2", (second, error), xytext=(5, 3), textcoords="offset points", fontsize=8)


def _against_frames(axes: Axes, found: Metrics, part: str) -> None:
    for number, tissue in enumerate(TISSUES[:3]):
        stem = f"{part}_l1_{tissue}_error_mean_"
        counts = sorted(int(name.removeprefix(stem)) for name in found if name.startswith(stem))
        values = [found[f"{stem}{count}"][0] for count in counts]
        axes.plot(
            counts,
            values,
            MARKS[part] + "-",
            color=f"C{number}",
            label=f"{part}: {NAMES.get(tissue, tissue)}",
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the picture and write the table."""
    parser = argparse.ArgumentParser(prog="benchmarks.levels.document", description=__doc__)
    write_document(parser, picture, table, arguments)


if __name__ == "__main__":
    main()
