"""Table 3 of Zheng 2022 with our columns."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.motions.sequences import PUBLISHED
from handpipe.core import Metrics

HEADS = (
    "sequence",
    "frames",
    "failed",
    "s a frame: median, mean, most",
    "h of one core",
    "Zheng 2022, h on 56 cores",
    "fat, muscles, flesh: %",
    "skin through skin",
    "inverted tets",
    "pops",
)


def table(scenes: Mapping[str, Metrics]) -> str:
    """A line a scene."""
    lines = [f"| {' | '.join(HEADS)} |", "| --- " * len(HEADS) + "|"]
    for name, found in scenes.items():
        value = {figure: number for figure, (number, _) in found.items()}
        seconds = ", ".join(f"{value[f'seconds_{part}']:.1f}" for part in ("median", "mean", "max"))
        shares = ", ".join(f"{value.get(f'{layer}_share', 0.0):.0f}" for layer in ("fat", "muscles", "flesh"))
        counts = [f"{value.get(c, 0.0):.0f}" for c in ("penetrations", "inverted_tets", "pops")]
        known = PUBLISHED[name]
        cells = [known.title, f"{value['frames']:.0f}", f"{value['failed_frames']:.0f}", seconds]
        cells += [f"{value['hours']:.2f}", f"{known.hours:g}", shares, *counts]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
