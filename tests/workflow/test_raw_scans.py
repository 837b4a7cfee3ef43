"""Scans as scanners write them: an independent reader finds the image at its place, and init finds all."""

from pathlib import Path

import numpy as np
import pytest
import SimpleITK
import trimesh

from handpipe.cli import main
from handpipe.core.configuration import load_dataset
from handpipe.develop import raw_scans
from handpipe.imaging.volumes import read_labels, read_volume

from .small_subject import AFFINE, SHAPE, image, seeds

LPS = np.array([-1.0, -1.0, 1.0])


@pytest.fixture
def raw(small: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Raw scans of the small subject in the folder `raw` of a working copy."""
    monkeypatch.chdir(small)
    assert raw_scans.main(["small", "raw", "--strokes"]) == 0
    return small / "raw"


def test_another_reader_finds_each_voxel_at_its_tilted_place(raw: Path) -> None:
    reader = SimpleITK.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(raw / "bent MR")))
    found = reader.Execute()
    step = float(image().max()) / raw_scans.LARGEST
    for index in np.random.default_rng(0).integers(0, SHAPE, (50, 3)):
        place = raw_scans.TILT(AFFINE[:3, :3] @ index + AFFINE[:3, 3])
        value = found.GetPixel(*found.TransformPhysicalPointToIndex((place * LPS).tolist()))
        assert value == pytest.approx(image()[tuple(index)], abs=step)


def test_strokes_and_scans_tilt_with_the_volume(raw: Path, small: Path) -> None:
    volume = read_volume(raw / "flat MR")
    labels = read_labels(raw / "flat-seeds.seg.nrrd", volume, {"near": 1, "far": 2})
    inside = np.argwhere(labels == 2)
    back = raw_scans.TILT.inverse()(volume.to_world(inside)) / AFFINE[0, 0]
    assert {tuple(np.round(p).astype(int)) for p in back} == {tuple(p) for p in np.argwhere(seeds() == 2)}
    scan, given = (trimesh.load(path) for path in (raw / "flat skin.stl", small / "small/flat.ply"))
    expected = trimesh.transform_points(given.bounds.mean(axis=0)[None], tilt_matrix())
    np.testing.assert_allclose(scan.bounds.mean(axis=0)[None], expected, atol=1e-3)


def test_mirrored_scans_are_those_of_the_other_hand(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(small)
    assert raw_scans.main(["small", "raw", "--strokes", "--mirrored"]) == 0
    reader = SimpleITK.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames("raw/bent MR"))
    found = reader.Execute()
    other = np.array([-1.0, 1.0, 1.0])
    step = float(image().max()) / raw_scans.LARGEST
    for index in np.random.default_rng(0).integers(0, SHAPE, (50, 3)):
        place = raw_scans.TILT(other * (AFFINE[:3, :3] @ index + AFFINE[:3, 3]))
        value = found.GetPixel(*found.TransformPhysicalPointToIndex((place * LPS).tolist()))
        assert value == pytest.approx(image()[tuple(index)], abs=step)
    volume = read_volume("raw/flat MR")
    labels = read_labels(Path("raw/flat-seeds.seg.nrrd"), volume, {"near": 1, "far": 2})
    back = other * raw_scans.TILT.inverse()(volume.to_world(np.argwhere(labels == 2))) / AFFINE[0, 0]
    assert {tuple(np.round(p).astype(int)) for p in back} == {tuple(p) for p in np.argwhere(seeds() == 2)}
    scan, given = trimesh.load("raw/flat skin.stl"), trimesh.load("small/flat.ply")
    assert scan.volume == pytest.approx(given.volume, rel=1e-5)  # negative if triangles turned inward


def tilt_matrix() -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = raw_scans.TILT.rotation, raw_scans.TILT.translation
    return matrix


def test_init_finds_all_of_them(raw: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--volumes", "raw", "--hand", "right", "--neutral", "flat"]
    assert main(["init", "new", *arguments]) == 0
    assert "to do" not in capsys.readouterr().out  # the strokes are there
    poses = load_dataset("config/datasets/new.yaml").poses
    assert poses["flat"].seeds == Path("flat-seeds.seg.nrrd")
    assert {n: (str(p.volume), str(p.scan)) for n, p in poses.items()} == {
        "flat": ("flat MR", "flat skin.stl"),
        "bent": ("bent MR", "bent skin.stl"),
    }


def test_a_folder_that_exists_is_left_alone(raw: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert raw_scans.main(["small", "raw"]) == 1
    assert "raw: folder: exists already" in capsys.readouterr().err
