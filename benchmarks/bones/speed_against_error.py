"""Errors over seconds: for the voxel size, the random walker's tolerance and the segmentation's settings."""

from __future__ import annotations

import functools
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from unittest import mock

from benchmarks.bones.cases import Case
from benchmarks.bones.hard_cases import Pair, judge
from benchmarks.bones.outcome import SETTINGS, registered, run, segmented
from benchmarks.bones.subject import FIVE, Conditions, Part
from handpipe.core import Array
from handpipe.imaging.segmentation import SegmentationSettings, segmentation
from handpipe.imaging.segmentation.random_walker import Stop, random_walker

log = logging.getLogger(__name__)

VOXELS = (0.4, 0.5, 0.65, 0.8, 1.0, 1.5)  # mm
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4)  # of the walker's probability
SWEPT = {  # the segmentation's settings: unit, values
    "margin": ("mm", (2.0, 4.0, 7.0, 12.0)),
    "beta": ("of contrast", (10.0, 30.0, 100.0, 300.0)),
    "dark": ("of the marrow's level", (0.2, 0.3, 0.4)),
}
PART = Part(poses=FIVE[:4])


@dataclass(frozen=True)
class Point:
    """One setting of one study, and the processor's seconds for all poses, images to rig.

    dice: mean and least; registration, rig: means in (deg, mm), the rig's on poses left out of its fit; None
    where nothing was found; missed: bones that did not reach the rig, in all poses.
    """

    study: str
    at: float
    dice: tuple[float, float] | None
    registration: Pair | None
    rig: Pair | None
    missed: int
    poses: int
    seconds: float


def measure(
    voxels: Sequence[float] = VOXELS,
    tolerances: Sequence[float] = TOLERANCES,
    swept: Mapping[str, Sequence[float]] | None = None,
    part: Part = PART,
) -> Iterator[Point]:
    """Every setting of the studies, the others at their usual values."""
    _point("compiles", voxels[-1], Conditions(spacing=voxels[-1]), part, SETTINGS)
    for spacing in voxels:
        yield _point("voxel size", spacing, Conditions(spacing=spacing), part, SETTINGS)
    for tolerance in tolerances:
        with mock.patch.object(segmentation, "random_walker", functools.partial(_walked, tolerance)):
            yield _point("tolerance", tolerance, Conditions(), part, SETTINGS)
    for name, values in ({n: v for n, (_, v) in SWEPT.items()} if swept is None else swept).items():
        for value in values:
            yield _point(name, value, Conditions(), part, SETTINGS.model_copy(update={name: value}))


def _walked(tolerance: float, *given: Any, **more: Any) -> Array:
    """What the random walker finds with another tolerance."""
    more["stop"] = more.get("stop", Stop())._replace(tolerance=tolerance)
    return random_walker(*given, **more)


def _point(
    study: str, at: float, conditions: Conditions, part: Part, settings: SegmentationSettings
) -> Point:
    segmented.cache_clear()  # kept bones would cost no time, and may be of another tolerance
    registered.cache_clear()
    case = Case(study, study, conditions, part.poses)
    outcome = run(case, part, settings)
    row = judge(case, outcome)
    missed = len(outcome.left_out)
    point = Point(
        study, at, row.dice, row.motion_mean, row.left_out, missed, len(part.poses), outcome.seconds
    )
    log.info("%s", point)
    return point
