"""Bones learned from several channels: each hides a part of the border, all of them show it."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.scans.foot import DRAWN_ON, ECHOES, STROKES
from benchmarks.scans.strokes import write_strokes
from phalanx import capsule, grid_points, voxelised
from test_learned import claimed, dice
from test_learned_foot import LOWER, MIDFOOT, UPPER

from handpipe.core.configuration import Dataset
from handpipe.imaging.learned import learned_doubts, segment_learned
from handpipe.imaging.segmentation import BACKGROUND, claims
from handpipe.imaging.volumes import read_labels, read_volume, write_labels
from handpipe.imaging.volumes.volume import write_volume
from handpipe.stages.images import correct_bone, segment_pose

CORNER, SPACING, RADIUS = 16.0, 1.0, 7.0
LABELS = {"shaft": 1}
BONE, BRIGHT = 0.4, 1.0
PATHS = sorted(ECHOES.glob("*.nii.gz"))


def distance(points):
    """Negative in the bone."""
    return capsule(points, (-6.0, 0, 0), (6.0, 0, 0)) - RADIUS


def channel(first):
    """Intensities in which muscle, or else fat, looks like bone; each lies on two sides of it."""

    def intensity(points):
        muscle = points[..., 1] * points[..., 2] > 0
        value = np.where(muscle == first, BONE, BRIGHT)
        return np.where(distance(points) < 0, BONE, value)

    return intensity


@pytest.fixture(scope="module")
def pair():
    """Two channels, and strokes in three slices."""
    box = (-CORNER,) * 3, (CORNER,) * 3
    volumes = [voxelised(channel(first), *box, noise=0.02, spacing=SPACING) for first in (True, False)]
    points = grid_points(volumes[0])
    drawn, away = np.isin(np.round(points[..., 2]), (-6, -3, 0, 3, 6)), distance(points)
    seeds = np.zeros(volumes[0].shape, np.uint8)
    seeds[drawn & ((np.abs(away - 2.5) < 0.6) | (np.abs(away - 6.0) < 0.6))] = BACKGROUND
    seeds[(np.abs(np.abs(points[..., 2]) - 10) < 0.6) & (np.abs(points[..., 1]) < 0.6)] = BACKGROUND
    seeds[drawn & (np.abs(away + 2.5) < 0.6)] = LABELS["shaft"]
    return volumes, seeds, away < 0


def found(channels, seeds):
    bones, wrong = segment_learned(channels, seeds, LABELS)
    assert not wrong
    return bones


def test_both_channels_are_nearer_to_the_truth_than_each(pair) -> None:
    volumes, seeds, truth = pair
    both = found(volumes, seeds)
    errors = [1 - dice(claimed(v, found([v], seeds)["shaft"]), truth) for v in volumes]
    assert 1 - dice(claimed(volumes[0], both["shaft"]), truth) < min(errors)
    assert learned_doubts(both) == {}


def test_stages_learn_from_the_channels_of_the_dataset(pair, tmp_path) -> None:
    volumes, seeds, truth = pair
    for name, volume in zip(("image", "fat"), volumes, strict=True):
        write_volume(tmp_path / f"{name}.nii.gz", volume)
    write_labels(tmp_path / "seeds.nii.gz", seeds, volumes[0].affine)
    write_labels(tmp_path / "none.nii.gz", np.zeros_like(seeds), volumes[0].affine)
    pose = {"role": "neutral", "volume": "image.nii.gz", "seeds": "seeds.nii.gz"}
    pose |= {"channels": {"fat": "fat.nii.gz"}, "scribbles": {"shaft": "none.nii.gz"}}
    bones = {name: {"label": label} for name, label in LABELS.items()}
    content = {"name": "shaft", "root": str(tmp_path), "contrast": "learned", "poses": {"rest": pose}}
    dataset = Dataset.model_validate(content | {"bones": bones, "joints": {}})
    image, strokes = tmp_path / "image.nii.gz", tmp_path / "seeds.nii.gz"
    channels = [tmp_path / "fat.nii.gz"]
    inputs = segment_pose.Inputs(volume=image, seeds=strokes, channels=channels)
    segment_pose.segment_pose(inputs, tmp_path / "bones.h5", dataset, "rest", ())
    further = correct_bone.Inputs(
        volume=image, seeds=strokes, scribbles=tmp_path / "none.nii.gz", channels=channels
    )
    correct_bone.correct_bone(further, tmp_path / "shaft.h5", dataset, "rest", "shaft")
    for file in ("bones.h5", "shaft.h5"):
        bone = claims.load(tmp_path / file)["shaft"]
        assert dice(claimed(volumes[0], bone), truth) > 0.93, file


@pytest.mark.slow
@pytest.mark.skipif(not PATHS, reason="the shared real MRI is not beside the checkout")
def test_bones_of_the_midfoot_by_all_echoes_agree_with_those_by_one(tmp_path) -> None:
    labels = write_strokes(STROKES, PATHS[DRAWN_ON], tmp_path / "seeds.nii.gz")
    volumes = [read_volume(path) for path in PATHS]
    seeds = read_labels(tmp_path / "seeds.nii.gz", volumes[DRAWN_ON])
    crops = [volume.crop(LOWER, UPPER) for volume in volumes]
    marks = seeds[tuple(slice(a, b) for a, b in zip(LOWER, UPPER, strict=True))]
    together, wrong = segment_learned(crops, marks, labels)
    alone, _ = segment_learned([crops[DRAWN_ON]], marks, labels)
    assert not (wrong | learned_doubts(together)).keys() & set(MIDFOOT)
    for name in MIDFOOT:
        assert dice(claimed(crops[0], together[name]), claimed(crops[0], alone[name])) > 0.95, name
