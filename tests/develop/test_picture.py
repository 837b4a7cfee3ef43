"""A frame is drawn twice, side by side: from outside, and with its inside."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from handpipe.core.layers import Frame, Shape
from handpipe.develop.picture import main
from handpipe.hand.frames import write_frames


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


def test_the_bone_shows_on_the_right_only(frames: Path, tmp_path: Path) -> None:
    assert main([str(frames), "rest", str(tmp_path / "hand.png")]) == 0
    picture = np.asarray(Image.open(tmp_path / "hand.png"), dtype=int)
    left, right = np.split(picture, 2, axis=1)
    middle, edge = (170, 240), (170, 110)
    assert left[middle][0] - left[middle][2] > right[middle][0] - right[middle][2]  # skin is redder than bone
    assert right[edge].min() > left[edge].min() + 50  # the skin around the bone is nearly transparent


def test_an_unknown_frame_is_named(frames: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(frames), "fist", str(tmp_path / "hand.png")]) == 1
    assert "fist" in capsys.readouterr().err
    assert not (tmp_path / "hand.png").exists()
