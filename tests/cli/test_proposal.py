"""Proposed strokes: a file that can be drawn on, written once, of the bones that were found for sure."""

from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pytest
import trimesh
import yaml

from handpipe.cli import main
from handpipe.core.configuration import load_dataset
from handpipe.imaging.volumes import pose_volume, read_labels
from handpipe.skeleton.localisation import BrightSolid, Named, SolidShape

SHAPE = (30, 24, 26)
AFFINE = np.array([[0, -1.0, 0, 5], [1.0, 0, 0, -3], [0, 0, 1.0, 8], [0, 0, 0, 1]])
BONES = {"hub": 1, "index": 2, "middle": 3, "ring": 4}
BLOCK = np.argwhere(np.ones((6, 6, 6), bool)) + [8, 9, 10]


def project(folder: Path, seeds: str, **further: Any) -> Path:
    """A subject of three fingers on one bone, its volume with a bright block in the dark."""
    values = np.full(SHAPE, 20.0, np.float32)
    values[tuple(BLOCK.T)] = 100.0
    nibabel.save(nibabel.Nifti1Image(values, AFFINE), folder / "volume.nii.gz")
    trimesh.creation.icosphere(subdivisions=1, radius=5.0).export(folder / "ball.ply")
    joints = {
        bone: {
            "parent": "hub",
            "child": bone,
            "angles": [f"{bone}_flexion"],
            "limits_deg": [[0, 90]],
            "axis_hints": [[1, 0, 0]],
        }
        for bone in list(BONES)[1:]
    }
    content = {
        "name": "mine",
        "root": str(folder),
        "poses": {"neutral": {"role": "neutral", "volume": "volume.nii.gz", "seeds": seeds}},
        "bones": {bone: {"label": label, "template": "ball.ply"} for bone, label in BONES.items()},
        "joints": joints,
    }
    (folder / "Snakefile").touch()
    source = folder / "config/datasets/mine.yaml"
    source.parent.mkdir(parents=True)
    source.write_text(yaml.safe_dump(content | further), encoding="utf-8")
    return source


def found(*sure: str) -> dict[str, Named]:
    """The block for the sure bones; all others are marked."""
    world = BLOCK @ AFFINE[:3, :3].T + AFFINE[:3, 3]
    solid = BrightSolid(BLOCK, SolidShape.fit(world, len(BLOCK)), 1.0, world)
    return {b: Named(solid, 0.9, "") if b in sure else Named(None, 0.0, "is not there") for b in BONES}


@pytest.mark.parametrize("seeds", ["strokes.seg.nrrd", "strokes.nii.gz"])
def test_strokes_of_sure_bones_are_written_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], seeds: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("handpipe.cli.drawing.proposal.name_solids", lambda *given: found("middle"))
    dataset = load_dataset(project(tmp_path, seeds))
    assert main(["propose", "mine"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[:3] == ["hub: marked: is not there", "index: marked: is not there", "middle: sure"]
    assert said[-1] == "Look at them before you build: handpipe draw mine neutral"
    volume = pose_volume(dataset, "neutral")
    strokes = read_labels(tmp_path / seeds, volume, dataset.seed_labels)
    assert set(np.unique(strokes)) == {0, BONES["middle"], 255}
    assert (volume.values[strokes == BONES["middle"]] == 100).all()
    assert (volume.values[strokes == 255] == 20).all()
    before = (tmp_path / seeds).read_bytes()
    assert main(["propose", "mine"]) == 1
    assert "exist already" in capsys.readouterr().err
    assert (tmp_path / seeds).read_bytes() == before


def test_nothing_is_written_where_no_bone_is_sure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    project(tmp_path, "strokes.nii.gz")
    assert main(["propose", "mine"]) == 1  # by the real search: there is no hand
    assert "no bone of neutral was found for sure" in capsys.readouterr().err
    assert not (tmp_path / "strokes.nii.gz").exists()


@pytest.mark.parametrize(
    ("further", "said"),
    [
        ({"bones": {bone: {"label": label} for bone, label in BONES.items()}}, "have no template"),
        ({"bones": {"hub": {"label": 1, "template": "ball.ply"}}, "joints": {}}, "0 fingers are too few"),
    ],
)
def test_a_hand_that_cannot_be_found_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    further: dict[str, Any],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    project(tmp_path, "strokes.nii.gz", **further)
    assert main(["propose", "mine"]) == 1
    assert said in capsys.readouterr().err
