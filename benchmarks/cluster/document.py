"""Table and picture of what more workers give."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from benchmarks.cluster.cases import WORKERS
from handpipe.core import Metrics

SHOWN = (1, 10, 100, 1000)  # workers of the table


def table(found: Metrics, texts: Mapping[str, str]) -> str:
    """By case: jobs, and by workers seconds, gain over one worker, and useful share of the workers' time."""
    heads = ["jobs that are submitted", "jobs", *(f"{n:,} worker{'s' * (n > 1)}" for n in SHOWN)]
    lines = [f"| {' | '.join(heads)} |", "| --- " * len(heads) + "|"]
    for case, text in texts.items():
        cells = [_cell(found, f"{case}_workers{n}") for n in SHOWN]
        lines.append(f"| {text} | {found[f'{case}_jobs'][0]:.0f} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(found: Metrics, name: str) -> str:
    values = [found[f"{name}_{figure}"][0] for figure in ("seconds", "speedup", "share")]
    return f"{values[0]:,.0f} s; {values[1]:.3g}; {100 * values[2]:.0f} %"


def picture(found: Metrics, texts: Mapping[str, str]) -> Figure:
    """Gain over one worker by the number of workers, one line a case."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(WORKERS, WORKERS, color="0.8", linewidth=4, label="as many times as workers")
    for case, text in texts.items():
        gains = [found[f"{case}_workers{n}_speedup"][0] for n in WORKERS]
        axes.plot(WORKERS, gains, "o-", markersize=3, label=text)
    axes.set(xscale="log", yscale="log", xlabel="workers", ylabel="times as fast as one worker")
    axes.legend(fontsize=8)
    return figure
