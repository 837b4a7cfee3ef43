"""A knee from either set of strokes to registered bones, by the stages that the workflow runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.imaging.volumes import Volume, read_labels, read_volume
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones import read_surfaces
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration import PoseImages, register_pose
from handpipe.stages.images import merge_labels, paint_strokes, prepare_image, propose_seeds, segment_pose

CHECKOUT = Path(__file__).parents[2]
DATASET = CHECKOUT / "config" / "datasets" / "knee.yaml"
STROKES = CHECKOUT / "tests" / "data" / "knee"
SETS = ("first", "second")
STRAIGHT, BENT = "R", "T"


@dataclass(frozen=True)
class Knee:
    """A build of the knee in a folder of its own.

    Parameters
    ----------
    dataset : Dataset
        The knee's dataset, with its root in `folder`.
    folder : Path
        Folder of the files.
    """

    dataset: Dataset
    folder: Path

    @staticmethod
    def build(folder: Path, strokes: str) -> Knee:
        """Segment both poses from one of the sets of strokes; files that are there are kept."""
        dataset = load_dataset(DATASET)
        assert dataset.limb is not None and dataset.anatomy is not None
        limb = dataset.limb.model_copy(update={"strokes": STROKES / f"strokes-{strokes}.json"})
        anatomy = dataset.anatomy if dataset.anatomy.is_absolute() else CHECKOUT / dataset.anatomy
        changed = {"limb": limb, "root": folder / "data", "anatomy": anatomy}
        knee = Knee(dataset.model_copy(update=changed), folder)
        for pose in (STRAIGHT, BENT):
            if not knee._file(pose, "surfaces.h5").exists():
                knee._segment(pose)
        return knee

    @staticmethod
    def absent() -> bool:
        """Whether the images are not on this machine."""
        anatomy = load_dataset(DATASET).anatomy
        return anatomy is None or not (CHECKOUT / anatomy).exists()

    def volume(self, pose: str) -> Volume:
        """The prepared image of a pose."""
        return read_volume(self.dataset.path(self.dataset.poses[pose].volume))

    def surfaces(self, pose: str, part: str = "marrow") -> dict[str, Surface]:
        """Surfaces of the bones of a pose."""
        return read_surfaces(self._file(pose, "surfaces.h5"), part)

    def region(self, pose: str, bone: str) -> BoolArray:
        """Voxels (nx, ny, nz) of a bone."""
        labels = read_labels(self._file(pose, "labels.nii.gz"), self.volume(pose))
        return labels == self.dataset.bones[bone].label

    def middle(self, pose: str, bone: str) -> Array:
        """Middle (3,) of a bone's voxels in mm of the build."""
        return self.volume(pose).to_world(np.argwhere(self.region(pose, bone)).mean(axis=0)[None])[0]

    def registered(self, source: str, target: str) -> dict[str, Registration]:
        """Registrations of the bones of one pose into the other."""
        part = "whole" if source == STRAIGHT else "marrow"  # that of the bent pose is not kept
        images = PoseImages(self.volume(source), self.volume(target), self.surfaces(source, part))
        return register_pose(self.dataset, self.surfaces(source), self.surfaces(target), images)

    def _segment(self, pose: str) -> None:
        """Seeds, labels and surfaces of a pose: strokes in the straight one, proposed seeds in the other."""
        assert self.dataset.limb is not None and self.dataset.anatomy is not None
        chosen, source = self.dataset.poses[pose], self.dataset.anatomy / self.dataset.limb.volumes[pose]
        image = self.dataset.path(chosen.volume)
        image.parent.mkdir(parents=True, exist_ok=True)
        self._file(pose, "").mkdir(parents=True, exist_ok=True)
        prepare_image.prepare_image(source, image, self.dataset)
        neutral = self._file(STRAIGHT, "surfaces.h5")
        if pose == STRAIGHT:
            assert chosen.seeds is not None
            seeds = self.dataset.path(chosen.seeds)
            seeds.parent.mkdir(parents=True, exist_ok=True)
            given = paint_strokes.Inputs(self.dataset.limb.strokes, source)
            paint_strokes.paint_strokes(given, seeds, self.dataset)
        else:
            seeds = self._file(pose, "seeds.nii.gz")
            located = (self._file(pose, name) for name in ("seeds.json", "located.h5"))
            outputs = propose_seeds.Outputs(seeds, *located)
            propose_seeds.propose_seeds(propose_seeds.Inputs(image, neutral), outputs, self.dataset, pose)
        bones = self._file(pose, "bones.h5")
        segment_pose.segment_pose(
            segment_pose.Inputs(image, seeds), bones, self.dataset, pose, tuple(chosen.scribbles)
        )
        looks = None if pose == STRAIGHT else self._file(STRAIGHT, "looks.json")
        scribbles = [self.dataset.path(path) for path in chosen.scribbles.values()]
        written = ("labels.nii.gz", "labels.json", "surfaces.h5", "looks.json")
        merge_labels.merge_labels(
            merge_labels.Inputs(image, seeds, bones, (), scribbles, looks),
            merge_labels.Outputs(*(self._file(pose, name) for name in written)),
            self.dataset,
            pose,
        )

    def _file(self, pose: str, name: str) -> Path:
        return self.folder / "segmentation" / pose / name
