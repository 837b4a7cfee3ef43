"""Marrow of each bone by a random walker in its local region (Wang 2019 §3.1)."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import ndimage

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.core.configuration import Dataset, Model
from handpipe.imaging.formats.segments import BACKGROUND
from handpipe.imaging.segmentation.distance_marks import distance_marks
from handpipe.imaging.segmentation.random_walker import INSIDE, OUTSIDE, Stop, random_walker
from handpipe.imaging.segmentation.sure_marks import parts_with, sure_marks
from handpipe.imaging.volumes.volume import Labels, Volume, box

logger = logging.getLogger(__name__)


BRIGHT_PERCENTILE = 99.0  # of the volume: fat and marrow
DARKEST = 0.2  # of that: air and cortical bone lie below, marrow at the dark end of a bias field far above
LONGEST = 110.0  # mm of marrow: half as much again as a long third metacarpal
TYPICAL = 0.75  # quantile of the intensities at a bone's seeds: in a narrow canal many voxels are half cortex
RISE = (1.15, 1.7)  # times the strokes' level, at which the marrow around them tells the level
UNDECIDED = 2e-4  # of the claimed voxels
ROUND = 0.6  # voxels: an opened part's corners are grown back as far
BEHIND = 30.0  # mm around its strokes in which parts behind a barrier are looked at: half of a metacarpal
SURROUNDINGS = 5.0  # mm around the marrow that the shell and its neighbourhood take


class SegmentationSettings(Model):
    """`beta` is the random walker's one parameter; the others say what marrow and a finger look like."""

    beta: float = Field(
        default=100.0, gt=0, description="contrast weight; intensities in units of the bone's marrow level"
    )
    margin: float = Field(default=7.0, gt=0, description="of the local region around a bone's seeds, mm")
    dark: float = Field(
        default=0.3, gt=0, lt=1, description="darker than this part of the marrow level is no marrow"
    )
    marks: Literal["intensity", "distance"] = Field(
        default="intensity",
        description="what tells voxels that need no walker: how far the intensity departs on the way to a "
        "stroke (bones of a hand), or how long the way is (limbs, whose fat is as bright as marrow)",
    )
    neck: float = Field(
        default=0.0, ge=0, description="what hangs on the strokes by less than this thickness is cut off, mm"
    )

    @staticmethod
    def from_dataset(dataset: Dataset) -> SegmentationSettings:
        """The settings of a subject: those of a hand, where its dataset says nothing else.

        Parameters
        ----------
        dataset : Dataset
            Dataset of the subject, of which `segmentation` is read.

        Returns
        -------
        SegmentationSettings
        """
        given = dataset.segmentation
        return (
            SegmentationSettings()
            if given is None
            else SegmentationSettings(marks=given.marks, neck=given.neck)
        )


@dataclass(frozen=True)
class BoneProbability:
    """Probability of one bone's marrow in a local region.

    Parameters
    ----------
    offset : array (3,) of int
        First voxel of the region in the whole volume.
    probability : array (nx, ny, nz) of float32
        Probability of marrow at each voxel of the region.
    undecided : float
        Volume in mm^3 of the largest bright part that the strokes do not decide.
    undecided_at : tuple of 3 floats
        Middle of that part, in voxels of the whole volume.
    trust : tuple of floats, optional
        Of a bone whose look was learned from strokes: the figures of its `Confidence`.
    """

    offset: IntArray
    probability: NDArray[np.float32]
    undecided: float = 0.0
    undecided_at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    trust: tuple[float, ...] | None = None

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        """The region within the whole volume."""
        return box(self.offset, self.offset + self.probability.shape)

    def at(self, indices: IntArray) -> NDArray[np.float32]:
        """Probability (m,) at voxels (m, 3) of the whole volume; 0 beyond the region."""
        local, inside = self._local(indices)
        out = np.zeros(len(indices), np.float32)
        out[inside] = self.probability[tuple(local[inside].T)]
        return out

    def set(self, indices: IntArray, values: NDArray) -> None:
        """Set the probability at voxels (m, 3) of the whole volume to values (m,), within the region."""
        local, inside = self._local(indices)
        self.probability[tuple(local[inside].T)] = values[inside]

    def _local(self, indices: IntArray) -> tuple[IntArray, BoolArray]:
        local = indices - self.offset
        inside = np.all((local >= 0) & (local < self.probability.shape), axis=1)
        return local, inside


def check_seeds(
    source: str | Path,
    seeds: Labels,
    bones: Mapping[str, int],
    scribbled: Collection[str] = (),
    others: Mapping[str, int] | None = None,
) -> None:
    """Check that seeds cover all bones and the background, and hold no unknown label.

    Parameters
    ----------
    source : str or Path
        File of the seeds, for messages.
    seeds : array (nx, ny, nz) of uint8
        Strokes: 0 for none, labels of bones, 255 for the background.
    bones : mapping of str to int
        Label of each bone that needs seeds.
    scribbled : collection of str, optional
        Bones that may have no seeds, since they have scribbles instead.
    others : mapping of str to int, optional
        Labels of further bones, for which seeds are optional.

    Raises
    ------
    InputError
        If a bone or the background has no seeds, or a label is unknown.
    """
    present = set(np.unique(seeds).tolist())
    for name, label in bones.items():
        if label not in present and name not in scribbled:
            raise InputError(
                source, "seeds", f"bone {name!r} (label {label}) has none", "Draw a stroke in its marrow"
            )
    if BACKGROUND not in present:
        problem = f"the background (label {BACKGROUND}) has none"
        raise InputError(source, "seeds", problem, "Draw strokes in the tissue around the bones")
    unknown = present - {*bones.values(), *(others or {}).values(), 0, BACKGROUND}
    if unknown:
        problem = f"labels {sorted(unknown)} are no bones of the dataset"
        raise InputError(source, "seeds", problem, "Relabel them, or add the bones to the dataset file")


def add_scribbles(seeds: Labels, scribbles: Labels, label: int | None = None) -> Labels:
    """Seeds overruled by extra scribbles.

    Parameters
    ----------
    seeds, scribbles : array (nx, ny, nz) of uint8
        Labels of strokes on the same grid, 0 for none.
    label : int, optional
        The only label whose scribbles count; by default all count.

    Returns
    -------
    array (nx, ny, nz) of uint8
        The scribble of a voxel if it has one, else its seed.
    """
    drawn = scribbles > 0 if label is None else scribbles == label
    return np.where(drawn, scribbles, seeds)


def segment_bone(
    volume: Volume, seeds: Labels, label: int, settings: SegmentationSettings
) -> BoneProbability:
    """Probability of one bone's marrow against everything else, in a box around the marrow.

    Seeds that disagree with the marrow's intensity are dropped. The box grows until the marrow ends inside it
    or at the volume's border.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    seeds : array (nx, ny, nz) of uint8
        Strokes: 0 for none, labels of bones, 255 for the background.
    label : int
        Label of the bone.
    settings : SegmentationSettings
        Settings of the random walker and of its region.

    Returns
    -------
    BoneProbability
        Probability in a box that holds the marrow and `SURROUNDINGS` mm around it.

    Raises
    ------
    InputError
        If the bone has no seeds, if they lie in darkness, or if the marrow that they lie in is longer than
        any bone of a hand.
    ConvergenceError
        If the random walker does not converge.
    """
    problem = local_problem(volume, seeds, label, settings)
    start = None
    while True:
        walked = walk(problem, volume.spacing, settings.beta, start)
        probability = _connected(walked, problem.marks == INSIDE)
        strokes = seeds[box(problem.offset, problem.offset + probability.shape)] == label
        probability = without_necks(probability, strokes, volume.spacing, settings.neck)
        bone = BoneProbability(problem.offset, probability.astype(np.float32), *problem.undecided)
        lower, upper = problem.offset, problem.offset + probability.shape
        if not touched(probability > 0.5, lower, upper, volume.shape).any():
            return _fitted(bone, volume)
        _check_length(probability > 0.5, volume.spacing, label)
        logger.info("label %d: the marrow reaches the border of its region; the region grows", label)
        lower, upper = _enlarged(volume, lower, upper, settings.margin)
        problem = _problem(volume, seeds, label, problem.level, lower, upper, settings)
        start = _in_box(bone, lower, upper)


@dataclass(frozen=True)
class LocalProblem:
    """What a bone's random walker is given in a box.

    Parameters
    ----------
    offset : array (3,) of int
        First voxel of the box in the whole volume.
    level : float
        Intensity of the bone's marrow.
    values : array (nx, ny, nz) of float32
        Intensities in units of that level.
    marks : array (nx, ny, nz) of uint8
        Seeds of the walker: 0 for free voxels, INSIDE or OUTSIDE.
    undecided : tuple
        Volume in mm^3 and middle (voxels of the whole volume) of the largest part that no stroke decides.
    """

    offset: IntArray
    level: float
    values: NDArray[np.float32]
    marks: NDArray[np.uint8]
    undecided: tuple[float, tuple[float, float, float]]


def local_problem(volume: Volume, seeds: Labels, label: int, settings: SegmentationSettings) -> LocalProblem:
    """The walker's problem in a box around all that a bone's strokes reach.

    The box grows where the marrow reaches its border, and within `BEHIND` of the strokes also where a part
    does that may be the bone's other end.

    Parameters
    ----------
    volume, seeds, label, settings
        As for `segment_bone`.

    Returns
    -------
    LocalProblem
        Values and marks in the box.

    Raises
    ------
    InputError
        As `segment_bone` does.
    """
    lower, upper, level = _around_seeds(volume, seeds, label)
    if settings.marks == "distance":
        return _cropped(_by_distance(volume, seeds, label, level, settings), volume)
    farthest = np.array(_enlarged(volume, lower, upper, BEHIND))
    lower, upper = _enlarged(volume, lower, upper, settings.margin)
    level = _risen(_problem(volume, seeds, label, level, lower, upper, settings))
    reach = settings.margin
    while True:
        problem, behind = _growing(volume, seeds, label, level, lower, upper, settings)
        inside = problem.marks == INSIDE
        reached = touched(inside, lower, upper, volume.shape)
        within = np.array([lower > farthest[0], upper < farthest[1]])
        faces = reached | (within & touched(behind, lower, upper, volume.shape))
        if not faces.any():
            break
        if reached.any():
            _check_length(inside, volume.spacing, label)
        low, high = _enlarged(volume, lower, upper, reach)
        low = np.where(reached[0], low, np.maximum(low, farthest[0]))
        high = np.where(reached[1], high, np.minimum(high, farthest[1]))
        lower, upper = np.where(faces[0], low, lower), np.where(faces[1], high, upper)
        reach *= 2
    return _cropped(problem, volume)


def _cropped(problem: LocalProblem, volume: Volume) -> LocalProblem:
    """The problem in the box of the voxels that are inside for sure, and `SURROUNDINGS` mm around them."""
    lower, upper = problem.offset, problem.offset + problem.marks.shape
    low, high = bounds(problem.marks == INSIDE)
    low, high = _enlarged(volume, lower + low, lower + high, SURROUNDINGS)
    low, high = np.maximum(low, lower), np.minimum(high, upper)
    region = box(low - lower, high - lower)
    return replace(problem, offset=low, values=problem.values[region], marks=problem.marks[region])


def _by_distance(
    volume: Volume, seeds: Labels, label: int, level: float, settings: SegmentationSettings
) -> LocalProblem:
    """The problem in the whole volume, with marks by the distances to all strokes."""
    values, own = volume.values / np.float32(level), seeds == label
    marks = distance_marks(values, own, (seeds != 0) & ~own, values < settings.dark, volume.spacing)
    return LocalProblem(np.zeros(3, np.int64), level, values, marks, (0.0, (0.0, 0.0, 0.0)))


def _risen(problem: LocalProblem) -> float:
    """The marrow's level around the strokes, which may lie in a canal's blurred voxels."""
    level = float(np.median(problem.values[problem.marks == INSIDE]))
    return problem.level * (level if RISE[0] < level < RISE[1] else 1.0)


def walk(problem: LocalProblem, spacing: NDArray, beta: float, start: NDArray | None = None) -> Array:
    """The walker's probability (nx, ny, nz), as exact as claims need it."""
    stop = Stop(undecided=UNDECIDED)
    return random_walker(problem.values, problem.marks, beta, start, spacing=spacing, stop=stop)


def _problem(
    volume: Volume,
    seeds: Labels,
    label: int,
    level: float,
    lower: IntArray,
    upper: IntArray,
    settings: SegmentationSettings,
) -> LocalProblem:
    """The problem in the box lower <= index < upper. Outside are other seeds and all dark voxels."""
    return _growing(volume, seeds, label, level, lower, upper, settings)[0]


def _growing(
    volume: Volume,
    seeds: Labels,
    label: int,
    level: float,
    lower: IntArray,
    upper: IntArray,
    settings: SegmentationSettings,
) -> tuple[LocalProblem, BoolArray]:
    """The problem in a box, and the voxels (nx, ny, nz) behind a barrier that may belong to the bone."""
    values, marked = volume.values[box(lower, upper)] / np.float32(level), seeds[box(lower, upper)]
    dark, other = values < settings.dark, (marked != 0) & (marked != label)
    found = sure_marks(values, (marked == label) & ~dark, other & ~dark, ~dark)
    marks = np.where(dark | other, OUTSIDE, found.marks).astype(np.uint8)
    x, y, z = (found.middle + lower).tolist()
    undecided = found.undecided * float(np.prod(volume.spacing)), (x, y, z)
    return LocalProblem(lower, level, values, marks, undecided), found.growing


def _enlarged(volume: Volume, lower: IntArray, upper: IntArray, margin: float) -> tuple[IntArray, IntArray]:
    """A box with `margin` mm more on each side, within the volume."""
    reach = np.ceil(margin / volume.spacing).astype(np.int64)
    return np.maximum(lower - reach, 0), np.minimum(upper + reach, volume.shape)


def _around_seeds(volume: Volume, seeds: Labels, label: int) -> tuple[IntArray, IntArray, float]:
    """The box of a bone's seeds, and the marrow's level at them."""
    own = np.argwhere(seeds == label)
    if len(own) == 0:
        raise InputError("seeds", f"label {label}", "has no seeds", "Draw a stroke in the bone's marrow")
    level = float(np.quantile(volume.values[tuple(own.T)], TYPICAL))
    bright = float(np.percentile(volume.values[::2, ::2, ::2], BRIGHT_PERCENTILE))
    if level < DARKEST * bright:
        problem = f"its seeds lie in darkness: {level:.3g}, where bright tissue is {bright:.3g}"
        raise InputError("seeds", f"label {label}", problem, "Draw its strokes in the bone's marrow")
    return own.min(0), own.max(0) + 1, level


def _check_length(claimed: BoolArray, spacing: NDArray, label: int) -> None:
    """Raise `InputError` where what the seeds lie in is longer than a bone of the hand."""
    low, high = bounds(claimed)
    length = float(np.max((high - low) * spacing))
    if length > LONGEST:
        problem = f"what its seeds lie in goes on for more than {length:.0f} mm, and no dark shell ends it"
        raise InputError(
            "seeds",
            f"label {label}",
            problem,
            "Draw its strokes in the bone's marrow alone, and strokes of the background around it",
        )


def _fitted(bone: BoneProbability, volume: Volume) -> BoneProbability:
    """The same probability in a box that holds the claimed voxels and `SURROUNDINGS` mm around them."""
    low, high = bounds(bone.probability > 0.5)
    lower, upper = _enlarged(volume, bone.offset + low, bone.offset + high, SURROUNDINGS)
    return replace(bone, offset=lower, probability=_in_box(bone, lower, upper))


def _in_box(bone: BoneProbability, lower: IntArray, upper: IntArray) -> NDArray[np.float32]:
    """Probability in the box of voxels lower <= index < upper; 0 beyond the bone's region."""
    out = np.zeros(upper - lower, np.float32)
    first = np.maximum(lower, bone.offset)
    last = np.minimum(upper, bone.offset + bone.probability.shape)
    out[box(first - lower, last - lower)] = bone.probability[box(first - bone.offset, last - bone.offset)]
    return out


def bounds(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """First voxel (3,) and the one after the last (3,) of a mask's box; the mask must not be empty."""
    spans = [np.flatnonzero(mask.any(axis=tuple(c for c in range(3) if c != axis))) for axis in range(3)]
    return np.array([s[0] for s in spans]), np.array([s[-1] + 1 for s in spans])


def _connected(probability: NDArray, seeds: BoolArray) -> NDArray:
    """Keep only the claimed voxels that are connected to a seed; fill holes inside the marrow."""
    claimed = probability > 0.5
    kept = parts_with(claimed, seeds)
    filled = ndimage.binary_fill_holes(kept)
    stray = claimed & ~kept
    return np.where(filled & ~kept, 1 - np.minimum(probability, 0.5), np.where(stray, 0.0, probability))


def without_necks(probability: NDArray, strokes: BoolArray, spacing: NDArray, neck: float) -> NDArray:
    """The probability without what claimed voxels thinner than `neck` mm join to the strokes.

    Strokes themselves are kept, however thin the marrow is there, and so is what lies within half a neck of
    them. Beyond the box's borders the marrow is taken to go on.
    """
    claimed = probability > 0.5
    if neck == 0 or not (claimed & strokes).any():
        return probability
    around = np.pad(claimed, 1, mode="edge")
    depth = ndimage.distance_transform_edt(around, sampling=spacing)[1:-1, 1:-1, 1:-1]
    core, own = (depth > neck / 2) | (strokes & claimed), strokes & claimed
    kept = parts_with(core, own)
    near = ndimage.distance_transform_edt(~kept, sampling=spacing) <= neck / 2 + ROUND * spacing.max()
    return np.where(claimed & ~near, 0.0, probability)


def touched(mask: BoolArray, lower: IntArray, upper: IntArray, shape: tuple[int, int, int]) -> BoolArray:
    """Which faces (2, 3), first and last along each axis, a mask reaches in its box lower <= index < upper.

    Faces that are faces of the whole volume do not count.
    """
    first = [bool(np.take(mask, 0, c).any()) and lower[c] > 0 for c in range(3)]
    last = [bool(np.take(mask, -1, c).any()) and upper[c] < shape[c] for c in range(3)]
    return np.array([first, last])
