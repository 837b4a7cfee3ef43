"""What a person draws on: a pose's volume, the labels of its bones, and the file of the strokes.

The page gets the volume with its axes as they are read, the order closest to RAS, and without their tilt. One
byte of the drawing is then one voxel of the volume, in the same order, however the file stores its axes.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import nibabel
import numpy as np
from numpy.typing import NDArray

from handpipe.core import InputError, paths
from handpipe.core.configuration import Dataset
from handpipe.imaging.segmentation import BACKGROUND
from handpipe.imaging.volumes import (
    Volume,
    colours,
    pose_volume,
    read_labels,
    write_labels,
    write_segments,
)

BACKGROUND_NAME, BACKGROUND_COLOUR = "background", (70, 110, 255)
FORMATS = (".nii", ".nii.gz", ".seg.nrrd")


@dataclass
class Canvas:
    """A volume, a drawing on it, and where the drawing is saved.

    `kept` is the copy of the file as it was before the first saving, if there was one.

    Parameters
    ----------
    title : str
        What is shown, for the page.
    volume : Volume
        Image under the drawing.
    labels : mapping of str to int
        Labels that may be drawn, by name; without the background.
    drawing : array (nx, ny, nz) of uint8
        Labels at the start.
    target : Path, optional
        File of the strokes; without it the drawing can only be looked at.
    """

    title: str
    volume: Volume
    labels: Mapping[str, int]
    drawing: NDArray[np.uint8]
    target: Path | None = None
    kept: Path | None = field(default=None, init=False)

    @property
    def colours(self) -> dict[str, tuple[int, int, int]]:
        """Colour of each label and of the background: sRGB, 0 to 255."""
        bones = {
            name: tuple(int(round(255 * c)) for c in colour)
            for name, colour in zip(self.labels, colours(len(self.labels)), strict=True)
        }
        found = {name: (r, g, b) for name, (r, g, b) in bones.items()}
        return found | ({} if self.target is None else {BACKGROUND_NAME: BACKGROUND_COLOUR})

    @property
    def pens(self) -> dict[str, int]:
        """Value of each label and, where strokes are drawn, of the background."""
        return {**self.labels} | ({} if self.target is None else {BACKGROUND_NAME: BACKGROUND})

    def image(self) -> bytes:
        """The volume as NIfTI without its tilt, for the page."""
        affine = np.diag([*self.volume.spacing, 1.0])
        return bytes(nibabel.Nifti1Image(self.volume.values, affine).to_bytes())

    def drawn(self) -> bytes:
        """One byte a voxel, the first axis fastest."""
        return self.drawing.tobytes(order="F")

    def save(self, drawn: bytes) -> int:
        """Write strokes that the page sends, one byte a voxel, in the frame of the volume.

        The file as it was at the start is copied beside it once. Returns the number of voxels with a label.

        Raises `InputError` for another number of voxels, and for values that are no label.
        """
        if self.target is None:
            raise InputError(
                self.title, "drawing", "can only be looked at", "Call handpipe draw without --look"
            )
        if len(drawn) != self.drawing.size:
            problem = f"has {len(drawn)} voxels; the volume has {self.drawing.size}"
            raise InputError(self.target, "drawing", problem, "Load the page again")
        values = np.frombuffer(drawn, np.uint8).reshape(self.drawing.shape, order="F")
        known = np.isin(np.arange(256), [0, *self.pens.values()])
        wrong = values[~known[values]]
        if wrong.size:
            raise InputError(self.target, "drawing", f"has the label {wrong[0]}", "Load the page again")
        self._keep(self.target)
        write_strokes(self.target, values, self.volume, self.labels)
        self.drawing = values
        return int(np.count_nonzero(values))

    def _keep(self, target: Path) -> None:
        """Copy an earlier file once."""
        if self.kept is not None or not target.is_file():
            return
        stem, _, suffixes = target.name.partition(".")
        kept = target.with_name(f"{stem}.before-{datetime.now():%Y%m%d-%H%M%S}.{suffixes}")
        shutil.copy2(target, kept)
        self.kept = kept


def strokes_to_draw(source: Path, dataset: Dataset, pose: str, bone: str | None = None) -> Canvas:
    """The seeds of a pose, or the scribbles of one bone, as they are or as they were proposed.

    Parameters
    ----------
    source : Path
        Dataset file, for messages.
    dataset : Dataset
        What it says.
    pose : str
        Name of a pose.
    bone : str, optional
        Bone whose scribbles are drawn, instead of the seeds of all bones.

    Returns
    -------
    Canvas

    Raises
    ------
    InputError
        For an unknown pose; where the dataset names no file for the strokes, or one of another format; and as
        `read_labels` and `pose_volume` do.
    """
    _require_pose(source, dataset, pose)
    what = f"poses.{pose}." + ("seeds" if bone is None else f"scribbles.{bone}")
    named = dataset.poses[pose].seeds if bone is None else dataset.poses[pose].scribbles.get(bone)
    target = file_of_strokes(source, dataset, what, named)
    volume = pose_volume(dataset, pose)
    proposed = paths.at(paths.SEEDS, subject=dataset.name, pose=pose)
    start = next((p for p in (target, *([proposed] if bone is None else [])) if p.is_file()), None)
    drawing = _labels(start, volume, dataset.seed_labels)
    title = f"{dataset.name}, {pose}: {'seeds' if bone is None else f'scribbles of {bone}'}"
    return Canvas(title, volume, dataset.seed_labels, drawing, target)


def file_of_strokes(source: Path, dataset: Dataset, what: str, named: Path | None) -> Path:
    """The file that strokes are written to. Raises `InputError` where there is none, or of another format."""
    if dataset.generator is not None:
        problem = f"the strokes of {dataset.name} are made by {dataset.generator}"
        raise InputError(source, what, problem, "Look at them by handpipe draw --look")
    if named is None:
        example = what.removesuffix(".seeds").rpartition(".")[-1] + "-strokes.nii.gz"
        remedy = f"Name the file that is to be written there, e.g. {example}"
        raise InputError(source, what, "names no file for the strokes", remedy)
    if not named.name.lower().endswith(FORMATS):
        raise InputError(source, what, f"{named} is none of {', '.join(FORMATS)}", "Name such a file")
    return dataset.path(named)


def write_strokes(target: Path, values: NDArray[np.uint8], volume: Volume, labels: Mapping[str, int]) -> None:
    """Write strokes, 255 for the background, in the frame of a volume; the suffix gives the format."""
    if target.name.lower().endswith(".seg.nrrd"):
        write_segments(target, values, volume.affine, {**labels, BACKGROUND_NAME: BACKGROUND})
    else:
        write_labels(target, values, volume.affine)


def labels_to_look_at(source: Path, dataset: Dataset, pose: str) -> Canvas:
    """The segmented bones of a pose over its volume; before they are built, its seeds.

    Parameters
    ----------
    source : Path
        Dataset file, for messages.
    dataset : Dataset
        What it says.
    pose : str
        Name of a pose.

    Returns
    -------
    Canvas
        Without a file to save to.

    Raises
    ------
    InputError
        For an unknown pose, and as `read_labels` and `pose_volume` do.
    """
    _require_pose(source, dataset, pose)
    seeds = dataset.poses[pose].seeds
    kinds = {
        "segmented bones": paths.at(paths.LABELS, subject=dataset.name, pose=pose),
        "seeds": paths.at(paths.SEEDS, subject=dataset.name, pose=pose)
        if seeds is None
        else dataset.path(seeds),
    }
    kind, start = next(((k, p) for k, p in kinds.items() if p.is_file()), ("volume alone", None))
    volume = pose_volume(dataset, pose)
    drawing = _labels(start, volume, dataset.seed_labels)
    return Canvas(f"{dataset.name}, {pose}: {kind}", volume, dataset.seed_labels, drawing)


def _labels(path: Path | None, volume: Volume, known: Mapping[str, int]) -> NDArray[np.uint8]:
    if path is None:
        return np.zeros(volume.shape, np.uint8)
    return read_labels(path, volume, known)


def _require_pose(source: Path, dataset: Dataset, pose: str) -> None:
    if pose not in dataset.poses:
        raise InputError(source, f"poses.{pose}", "is no pose", f"The poses are {', '.join(dataset.poses)}")
