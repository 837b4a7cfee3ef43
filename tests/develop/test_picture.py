"""A frame is drawn three times, side by side: from outside, with its inside, and cut open."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from handpipe.core.layers import Frame, Shape
from handpipe.develop.picture import main
from handpipe.hand import colour
from handpipe.hand.frames import write_frames
from handpipe.imaging.volumes import Volume, write_volume


def ball(radius: float) -> Shape:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    vertices = np.array(mesh.vertices)
    return Shape(vertices, vertices, np.array(mesh.faces, dtype=np.int64))


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """One frame: a bone inside a skin."""
    layers = {"bones": {"bone": ball(5.0)}, "skin": {"skin": ball(10.0)}}
    write_frames(tmp_path / "frames-0.h5", [(Frame("rest", {}, {}), layers)])
    return tmp_path / "frames-0.h5"


def test_the_bone_shows_inside_and_in_the_cut_only(frames: Path, tmp_path: Path) -> None:
    assert main([str(frames), "rest", str(tmp_path / "hand.png")]) == 0
    picture = np.asarray(Image.open(tmp_path / "hand.png"), dtype=int)
    outside, inside, cut = np.split(picture, 3, axis=1)
    middle, edge = (240, 240), (240, 80)
    assert outside[middle][0] - outside[middle][2] > inside[middle][0] - inside[middle][2]  # skin is redder
    assert inside[edge].min() > outside[edge].min() + 50  # the skin around the bone is nearly transparent
    np.testing.assert_allclose(cut[middle], 255 * np.array(colour("bones")), atol=2)
    np.testing.assert_allclose(cut[edge], 255 * np.array(colour("fat")), atol=2)


def test_a_volume_is_drawn_by_a_transfer_function_of_a_known_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = np.zeros((20, 20, 20), np.float32)
    values[5:15, 5:15, 5:15] = 100.0
    write_volume(tmp_path / "a.nii.gz", Volume(values, np.eye(4)))
    assert main([str(tmp_path / "a.nii.gz"), "fat", str(tmp_path / "a.png")]) == 0
    assert np.asarray(Image.open(tmp_path / "a.png"))[240, 240].min() < 200
    assert main([str(tmp_path / "a.nii.gz"), "skin", str(tmp_path / "b.png")]) == 1
    assert "anatomy, fat" in capsys.readouterr().err


def test_an_unknown_frame_is_named(frames: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(frames), "fist", str(tmp_path / "hand.png")]) == 1
    assert "fist" in capsys.readouterr().err
    assert not (tmp_path / "hand.png").exists()
