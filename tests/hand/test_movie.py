"""A scene's movie: as many pictures as frames, none where frames are missing."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image as images

from handpipe.core import Frame, InputError, RigidTransform, Shape
from handpipe.hand import Failure, write_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.views import render_movie


class Subject:
    hand = "right"


def chunk(path: Path, names: list[str], failures=()) -> Path:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=5.0)
    cells = np.asarray(ball.faces, dtype=np.int64)
    frames = []
    for number, name in enumerate(names):
        moved = np.asarray(ball.vertices) + [4.0 * number, 0, 0]
        layers = {"bones": {"ball": Shape(np.asarray(ball.vertices), moved, cells)}}
        frames.append((Frame(name, {}, {"ball": RigidTransform.identity()}), layers))
    write_frames(path, frames, failures=failures)
    return path


@pytest.fixture
def inputs(tmp_path: Path) -> render_movie.Inputs:
    ball = chunk(tmp_path / "frames-0.h5", ["a", "b"]), chunk(tmp_path / "frames-1.h5", ["c"])
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=5.0)
    surface = Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))
    Rig("ball", (), {"ball": surface}, {}).save(tmp_path / "rig.h5")
    return render_movie.Inputs(rig=tmp_path / "rig.h5", chunks=ball)


def test_a_movie_has_a_picture_for_each_frame(inputs: render_movie.Inputs, tmp_path: Path):
    render_movie.render_movie(inputs, tmp_path / "m.webp", Subject())
    with images.open(tmp_path / "m.webp") as movie:
        width, height = render_movie.SIZE
        assert (movie.n_frames, movie.size) == (3, (2 * width, height))
        middles = []
        for number in range(3):
            movie.seek(number)
            movie.load()
            assert movie.info["duration"] == round(1000 / 24)
            dark = np.asarray(movie.convert("L"))[:, :width] < 230
            middles.append(np.argwhere(dark).mean(axis=0))
    steps = np.diff(middles, axis=0)  # distal is upwards: rows fall by the same step
    assert steps[0, 0] < -20 and abs(steps[0, 1]) < 1  # the second chunk begins at rest


def test_a_movie_of_failed_frames_is_refused(inputs: render_movie.Inputs, tmp_path: Path):
    chunk(tmp_path / "frames-1.h5", ["c"], [Failure("d", "fat", "no luck")])
    with pytest.raises(InputError, match="d failed"):
        render_movie.render_movie(inputs, tmp_path / "m.webp", Subject())
    assert not (tmp_path / "m.webp").exists()
