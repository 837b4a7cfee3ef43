"""The stages on a dataset whose contrast is learned: from files of images and strokes to whole bones."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from phalanx import grid_points, voxelised
from pydantic import ValidationError
from test_learned import LABELS, LOWER, SPACING, UPPER, dice, distance, intensity, strokes

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.volumes import read_labels, write_labels
from handpipe.imaging.volumes.volume import write_volume
from handpipe.skeleton.bones import read_surfaces
from handpipe.stages.images import correct_bone, merge_labels, segment_pose


def content(folder):
    pose = {"role": "neutral", "volume": "image.nii.gz", "seeds": "seeds.nii.gz"}
    hinge = {"parent": "proximal", "child": "distal", "angles": ["hinge"]}
    hinge |= {"limits_deg": [[-10, 90]], "axis_hints": [[0, 1, 0]]}
    return {
        "name": "joint",
        "root": str(folder),
        "contrast": "learned",
        "poses": {"straight": pose},
        "bones": {name: {"label": label} for name, label in LABELS.items()},
        "joints": {"hinge": hinge},
    }


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = tmp_path_factory.mktemp("joint")
    volume = voxelised(intensity, LOWER, UPPER, noise=0.01, spacing=SPACING)
    write_volume(folder / "image.nii.gz", volume)
    write_labels(folder / "seeds.nii.gz", strokes(volume), volume.affine)
    write_labels(folder / "more.nii.gz", np.zeros(volume.shape, np.uint8), volume.affine)
    return folder, volume, Dataset.model_validate(content(folder))


def segmented(subject, dataset):
    folder = subject[0]
    inputs = segment_pose.Inputs(volume=folder / "image.nii.gz", seeds=folder / "seeds.nii.gz")
    segment_pose.segment_pose(inputs, folder / "bones.h5", dataset, "straight", ())
    return folder / "bones.h5"


def merged(subject, dataset, bones, corrected=()):
    folder = subject[0]
    inputs = merge_labels.Inputs(
        volume=folder / "image.nii.gz",
        seeds=folder / "seeds.nii.gz",
        bones=bones,
        corrected=corrected,
        scribbles=[folder / "more.nii.gz"] * len(corrected),
        neutral=None,
    )
    outputs = merge_labels.Outputs(
        labels=folder / "labels.nii.gz",
        table=folder / "labels.json",
        surfaces=folder / "surfaces.h5",
        looks=folder / "looks.json",
    )
    merge_labels.merge_labels(inputs, outputs, dataset, "straight")
    return outputs


def test_stages_give_whole_bones(subject) -> None:
    _, volume, dataset = subject
    outputs = merged(subject, dataset, segmented(subject, dataset))
    labels = read_labels(outputs.labels, volume)
    surfaces = read_surfaces(outputs.surfaces, "whole")
    for name, label in LABELS.items():
        assert dice(labels == label, distance(name, grid_points(volume)) < 0) > 0.95
        assert np.abs(distance(name, surfaces[name].vertices)).mean() < 0.3
    assert json.loads(outputs.looks.read_text())["left_out"] == {}


def test_a_corrected_bone_replaces_the_first(subject) -> None:
    folder, volume, dataset = subject
    poses = {"straight": content(folder)["poses"]["straight"] | {"scribbles": {"distal": "more.nii.gz"}}}
    dataset = Dataset.model_validate(content(folder) | {"poses": poses})
    inputs = correct_bone.Inputs(
        volume=folder / "image.nii.gz", seeds=folder / "seeds.nii.gz", scribbles=folder / "more.nii.gz"
    )
    correct_bone.correct_bone(inputs, folder / "distal.h5", dataset, "straight", "distal")
    outputs = merged(subject, dataset, segmented(subject, dataset), [folder / "distal.h5"])
    labels = read_labels(outputs.labels, volume)
    assert dice(labels == LABELS["distal"], distance("distal", grid_points(volume)) < 0) > 0.95


def test_bright_marrow_is_refused_here(subject) -> None:
    folder, _, _ = subject
    dataset = Dataset.model_validate(content(folder) | {"contrast": "bright_marrow"})
    with pytest.raises(InputError):
        merged(subject, dataset, segmented(subject, dataset))


def test_every_pose_needs_strokes(subject) -> None:
    data = content(subject[0])
    data["poses"]["bent"] = {"role": "example", "volume": "image.nii.gz"}
    with pytest.raises(ValidationError, match="bent: needs seeds"):
        Dataset.model_validate(yaml.safe_load(yaml.safe_dump(data)))
