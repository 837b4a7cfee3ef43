"""Marrow of each bone by a random walker in its local region; merging of bones (Wang 2019, Sec. 3.1)."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import ndimage

from handpipe import artifacts
from handpipe.config import Model
from handpipe.errors import InputError
from handpipe.imaging.random_walker import INSIDE, OUTSIDE, random_walker
from handpipe.imaging.volume import Labels, Volume, box

logger = logging.getLogger(__name__)

BACKGROUND = 255
KIND = "bone_probability"


class SegmentationSettings(Model):
    """`beta` is the random walker's one parameter; the rest says what marrow and a finger look like."""

    beta: float = Field(
        100.0, gt=0, description="contrast weight; intensities in units of the bone's marrow level"
    )
    margin: float = Field(7.0, gt=0, description="of the local region around a bone's seeds, mm")
    dark: float = Field(0.3, gt=0, lt=1, description="darker than this part of the marrow level is no marrow")


@dataclass(frozen=True)
class BoneProbability:
    """Probability (nx, ny, nz) of marrow in a local region, whose first voxel is voxel `offset` (3,)."""

    offset: NDArray[np.int64]
    probability: NDArray[np.float32]

    @property
    def slices(self) -> tuple[slice, slice, slice]:
        """The region within the whole volume."""
        return box(self.offset, self.offset + self.probability.shape)

    def save(self, path: str | Path, inputs: Iterable[str | Path] = ()) -> None:
        """Write as an artifact."""
        data: dict[str, Any] = {"offset": self.offset, "probability": self.probability}
        artifacts.write(path, data, kind=KIND, units={"probability": "1"}, inputs=list(inputs))

    @staticmethod
    def load(path: str | Path) -> BoneProbability:
        """Read an artifact; raises `InputError` as `artifacts.read` does."""
        data = artifacts.read(path, KIND)
        return BoneProbability(data["offset"], data["probability"])


def check_seeds(source: str | Path, seeds: Labels, bones: Mapping[str, int]) -> None:
    """Raise `InputError` where seeds (nx, ny, nz) lack a bone or the background, or hold unknown labels."""
    present = set(np.unique(seeds).tolist())
    for name, label in bones.items():
        if label not in present:
            raise InputError(
                source, "seeds", f"bone {name!r} (label {label}) has none", "Draw a stroke in its marrow"
            )
    if BACKGROUND not in present:
        problem = f"the background (label {BACKGROUND}) has none"
        raise InputError(source, "seeds", problem, "Draw strokes in the tissue around the bones")
    unknown = present - set(bones.values()) - {0, BACKGROUND}
    if unknown:
        problem = f"labels {sorted(unknown)} are no bones of the dataset"
        raise InputError(source, "seeds", problem, "Relabel them, or add the bones to the dataset file")


def add_scribbles(seeds: Labels, scribbles: Labels) -> Labels:
    """Seeds (nx, ny, nz) overruled by extra scribbles on the same grid."""
    return np.where(scribbles > 0, scribbles, seeds)


def segment_bone(
    volume: Volume, seeds: Labels, label: int, settings: SegmentationSettings
) -> BoneProbability:
    """Probability of one bone's marrow against everything else, in a box around its seeds.

    seeds (nx, ny, nz): 0 none, bone labels, 255 background. Seeds that disagree with the marrow's
    intensity are dropped; the box grows until the marrow ends inside it.
    Raises `InputError` where the bone has no seeds.
    """
    own = np.argwhere(seeds == label)
    if len(own) == 0:
        raise InputError("seeds", f"label {label}", "has no seeds", "Draw a stroke in the bone's marrow")
    level = float(np.median(volume.values[tuple(own.T)]))
    shape = np.array(volume.shape)
    margin = np.ceil(settings.margin / volume.spacing).astype(np.int64)
    lower, upper = own.min(0), own.max(0) + 1
    while True:
        lower, upper = np.maximum(lower - margin, 0), np.minimum(upper + margin, shape)
        region = box(lower, upper)
        values = volume.values[region] / level
        marks = _marks(values, seeds[region], label, settings.dark)
        probability = _connected(random_walker(values, marks, settings.beta), marks == INSIDE)
        if not _touches_border(probability > 0.5, lower > 0, upper < shape):
            return BoneProbability(lower, probability.astype(np.float32))
        logger.info("label %d: its marrow leaves the region; growing the region", label)


def _marks(values: NDArray, seeds: Labels, label: int, dark: float) -> NDArray[np.uint8]:
    """The walker's seeds: the bone inside; other seeds and all dark voxels outside."""
    outside = ((seeds != 0) & (seeds != label)) | (values < dark)
    return np.where(outside, OUTSIDE, np.where(seeds == label, INSIDE, 0)).astype(np.uint8)


def _connected(probability: NDArray, seeds: NDArray[np.bool_]) -> NDArray:
    """Keep only the claimed voxels that hang together with a seed; holes inside the marrow are filled."""
    parts, _ = ndimage.label(probability > 0.5)
    kept = np.isin(parts, np.setdiff1d(parts[seeds], 0))
    filled = ndimage.binary_fill_holes(kept)
    stray = (parts > 0) & ~kept
    return np.where(filled & ~kept, 1 - np.minimum(probability, 0.5), np.where(stray, 0.0, probability))


def _touches_border(claimed: NDArray[np.bool_], low: NDArray, high: NDArray) -> bool:
    """Whether a mask reaches a face of its box that is not a face of the whole volume."""
    faces = [(low[c], np.take(claimed, 0, c)) for c in range(3)]
    faces += [(high[c], np.take(claimed, -1, c)) for c in range(3)]
    return any(bool(inner) and bool(face.any()) for inner, face in faces)


def merge(
    volume: Volume,
    bones: Mapping[int, BoneProbability],
    seeds: Labels,
    settings: SegmentationSettings,
) -> tuple[Labels, dict[int, BoneProbability]]:
    """Labels (nx, ny, nz) of all bones, and the probabilities with conflicts resolved.

    bones: by label. Voxels claimed by two bones become unlabelled, and each conflict is solved again in
    a local region with the sure voxels around it as seeds (Wang 2019, Sec. 3.1).
    """
    claims = np.zeros(volume.shape, np.uint8)
    labels = np.zeros(volume.shape, np.uint8)
    for label, bone in bones.items():
        claimed = bone.probability > 0.5
        claims[bone.slices] += claimed
        labels[bone.slices][claimed] = label
    labels[claims > 1] = 0
    resolved = {label: bone.probability.copy() for label, bone in bones.items()}
    conflicts, count = ndimage.label(claims > 1)
    for number, slices in enumerate(ndimage.find_objects(conflicts), 1):
        logger.info("conflict %d of %d between bones", number, count)
        _resolve(volume, labels, conflicts == number, slices, seeds, bones, resolved, settings)
    return labels, {label: BoneProbability(bones[label].offset, p) for label, p in resolved.items()}


def _resolve(
    volume: Volume,
    labels: Labels,
    conflict: NDArray[np.bool_],
    slices: tuple[slice, slice, slice],
    seeds: Labels,
    bones: Mapping[int, BoneProbability],
    resolved: dict[int, NDArray[np.float32]],
    settings: SegmentationSettings,
) -> None:
    """Share one conflict's voxels among the bones by a walker for each; updates labels and probabilities."""
    reach = 4
    lower = np.maximum([s.start - reach for s in slices], 0)
    upper = np.minimum([s.stop + reach for s in slices], volume.shape)
    region = box(lower, upper)
    free = conflict[region]
    rivals = [k for k in bones if (labels[region] == k).any() or _claims(bones[k], conflict)]
    level = np.median(volume.values[region][free])
    chances = []
    for label in rivals:
        sure = np.where((labels[region] == label) | (seeds[region] == label), INSIDE, OUTSIDE)
        chances.append(random_walker(volume.values[region] / level, np.where(free, 0, sure), settings.beta))
    winner = np.array([0, *rivals], np.uint8)[np.argmax([np.full(free.shape, 0.5), *chances], axis=0)]
    labels[region][free] = winner[free]
    for label, chance in zip(rivals, chances, strict=True):
        own = np.where(winner == label, chance, np.minimum(chance, 0.5))  # one owner, to the last digit
        _overwrite(resolved[label], bones[label].offset, lower, own, free)


def _claims(bone: BoneProbability, voxels: NDArray[np.bool_]) -> bool:
    """Whether a bone claims any of the volume's voxels."""
    return bool(((bone.probability > 0.5) & voxels[bone.slices]).any())


def _overwrite(
    target: NDArray, offset: NDArray, lower: NDArray, values: NDArray, where: NDArray[np.bool_]
) -> None:
    """Set values, given on a box at `lower`, where asked, in an array whose first voxel is `offset`."""
    index = np.argwhere(where)
    local = index + lower - offset
    inside = ((local >= 0) & (local < target.shape)).all(axis=1)
    target[tuple(local[inside].T)] = values[tuple(index[inside].T)]
