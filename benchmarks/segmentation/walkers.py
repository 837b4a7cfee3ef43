"""Both walkers on the same problem: seconds, Dice against truth, and how far from the exact solution.

scikit-image scales its contrast weight by the image's deviation; with `beta` times ten times that deviation
both solve the same equations. Each stops by a rule of its own: the error left is measured against a solution
of ours that is solved much farther.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from skimage import segmentation

from benchmarks.segmentation.regions import SETTINGS, Region
from handpipe.core import Array
from handpipe.imaging.segmentation.random_walker import Stop, random_walker
from handpipe.imaging.segmentation.segmentation import walk

MODES = ("cg_j", "cg_mg")  # cg_mg needs pyamg; "cg" and "bf" are slower in three dimensions
EXACT = 1e-5


@dataclass(frozen=True)
class Run:
    """Median seconds of the processor, on one thread; Dice of the claim against the true marrow; largest
    error of the probability."""

    seconds: float
    dice: float
    error: float


def ours(region: Region) -> Array:
    """Probability (nx, ny, nz) of the bone's marrow by the project's walker, as the segmentation uses it."""
    return walk(region.problem, region.spacing, SETTINGS.beta)


def exact(region: Region) -> Array:
    """The same without its early end and with a tolerance a hundred times smaller."""
    problem = region.problem
    return random_walker(
        problem.values,
        problem.marks,
        SETTINGS.beta,
        spacing=region.spacing,
        stop=Stop(tolerance=EXACT, max_iterations=2000),
    )


def theirs(region: Region, mode: str) -> Array:
    """The same by scikit-image's, at its own default tolerance."""
    problem = region.problem
    values = problem.values.astype(float)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on tolerances that are not reached: the error is measured
        found = segmentation.random_walker(
            values,
            problem.marks.astype(np.int32),
            beta=SETTINGS.beta * 10 * values.std(),
            mode=mode,
            return_full_prob=True,
        )
    return np.asarray(found[0])


def run(region: Region, walker: Callable[[Region], Array], solution: Array, repeats: int) -> Run:
    """A walker's figures in one region."""
    seconds = []
    for _ in range(repeats):
        begun = time.process_time()
        probability = walker(region)
        seconds.append(time.process_time() - begun)
    claimed = probability > 0.5
    dice = 2 * (claimed & region.truth).sum() / max(claimed.sum() + region.truth.sum(), 1)
    return Run(float(np.median(seconds)), float(dice), float(np.abs(probability - solution).max()))
