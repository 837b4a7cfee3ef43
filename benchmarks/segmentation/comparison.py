"""The project's walker against scikit-image's in every region: ratios of time, differences of Dice."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from benchmarks.fem.machine import Figures, facts, figure
from benchmarks.segmentation.regions import Region, regions
from benchmarks.segmentation.walkers import MODES, Run, exact, ours, run, theirs
from handpipe.core import Array
from handpipe.core.configuration import Dataset

log = logging.getLogger(__name__)

OURS = "handpipe"


def measure(dataset: Dataset, poses: Sequence[str], bones: Sequence[str], repeats: int) -> Figures:
    """`{walker}_{seconds,dice,error}_{bone}_{pose}` of each walker and region, and `summary`."""
    modes = [m for m in MODES if m != "cg_mg" or importlib.util.find_spec("pyamg")]
    walkers = {OURS: ours} | {mode: partial(theirs, mode=mode) for mode in modes}
    places = [region for pose in poses for region in regions(dataset, pose, bones)]
    ours(places[0])  # compiles
    runs = [compared(region, walkers, repeats) for region in places]
    figures: Figures = {**facts(), **summary(runs)}
    for region, found in zip(places, runs, strict=True):
        name = f"{region.bone}_{region.pose}"
        figures[f"voxels_{name}"] = figure(region.truth.size, "1")
        for walker, result in found.items():
            figures[f"{walker}_seconds_{name}"] = figure(result.seconds, "s")
            figures[f"{walker}_dice_{name}"] = figure(result.dice, "1")
            figures[f"{walker}_error_{name}"] = figure(result.error, "1")
    return figures


def compared(
    region: Region, walkers: Mapping[str, Callable[[Region], Array]], repeats: int
) -> dict[str, Run]:
    """Every walker's run in one region, in turn in this process."""
    solution = exact(region)
    found = {name: run(region, walk, solution, repeats) for name, walk in walkers.items()}
    log.info("%s in %s: %s", region.bone, region.pose, found)
    return found


def summary(runs: Sequence[Mapping[str, Run]]) -> Figures:
    """Totals over the regions against scikit-image's fastest mode.

    `speed_ratio_skimage`: its seconds over ours, of all regions; the least of a region; `dice_difference_…`:
    our Dice less its; the largest errors of the probability.
    """
    modes = [name for name in runs[0] if name != OURS]
    seconds = {name: sum(found[name].seconds for found in runs) for name in (OURS, *modes)}
    best = min(modes, key=lambda name: seconds[name])
    gains = [found[OURS].dice - found[best].dice for found in runs]
    figures: Figures = {
        "skimage_mode": {"value": best, "unit": "text"},
        "speed_ratio_skimage": figure(seconds[best] / seconds[OURS], "1"),
        "speed_ratio_skimage_min": figure(min(f[best].seconds / f[OURS].seconds for f in runs), "1"),
        "dice_difference_min": figure(min(gains), "1"),
        "dice_difference_mean": figure(float(np.mean(gains)), "1"),
    }
    for name in (OURS, *modes):
        figures[f"{name}_seconds"] = figure(seconds[name], "s")
        figures[f"{name}_dice_mean"] = figure(float(np.mean([found[name].dice for found in runs])), "1")
        figures[f"{name}_error_max"] = figure(max(found[name].error for found in runs), "1")
    return figures
