"""The local regions and seeds in which both walkers are run, and the truth there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from handpipe.core import Array, BoolArray
from handpipe.core.configuration import Dataset
from handpipe.imaging.segmentation import SegmentationSettings
from handpipe.imaging.segmentation.segmentation import LocalProblem, local_problem
from handpipe.imaging.volumes import read_labels, read_volume
from handpipe.imaging.volumes.volume import box

SETTINGS = SegmentationSettings.model_validate({})


@dataclass(frozen=True)
class Region:
    """One bone's problem in one pose, its true marrow (nx, ny, nz), and the voxels' spacing (3,) in mm."""

    bone: str
    pose: str
    problem: LocalProblem
    truth: BoolArray
    spacing: Array


def regions(dataset: Dataset, pose: str, bones: Sequence[str]) -> list[Region]:
    """The first region of each bone, as the segmentation takes it around the bone's seeds.

    The dataset needs seeds in the pose, and truth.
    """
    files = dataset.poses[pose]
    if files.seeds is None or dataset.truth is None:
        raise ValueError(f"{dataset.name}: no seeds in {pose}, or no truth")
    volume = read_volume(dataset.path(files.volume))
    seeds = read_labels(dataset.path(files.seeds), volume)
    truth = read_labels(dataset.path(dataset.truth.folder) / f"{pose}.marrow.nii.gz", volume)
    found = []
    for bone in bones:
        label = dataset.bones[bone].label
        problem = local_problem(volume, seeds, label, SETTINGS)
        inside = box(problem.offset, problem.offset + problem.marks.shape)
        found.append(Region(bone, pose, problem, truth[inside] == label, volume.spacing))
    return found
