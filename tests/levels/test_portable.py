"""The reader of docs/levels.md plays a written archive as the library plays the hand."""

import re
from pathlib import Path

import numpy as np
import pytest

from handpipe.levels.fast_skeleton import FastSkeleton
from handpipe.levels.learning import learn
from handpipe.levels.portable import write_portable

from .test_kernels import five_fingers
from .three_bones import random_frames, rig

PAGE = Path(__file__).parents[2] / "docs" / "levels.md"


@pytest.fixture(scope="module")
def reader() -> dict:
    """The functions of the page."""
    found = re.search(r"<!-- reader -->\n```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    names: dict = {}
    exec(found.group(1), names)
    return names


def test_the_reader_gives_the_vertices_of_l1(reader: dict, tmp_path: Path) -> None:
    hand = learn(random_frames(30), rig())
    write_portable(tmp_path / "levels.npz", hand)
    read = dict(np.load(tmp_path / "levels.npz"))
    for degrees in ([10.0, 20.0], [75.0, -15.0], [0.0, 0.0]):
        angles = np.radians(degrees)
        assert reader["pose"](read, angles) == pytest.approx(hand.vertices(angles, "L1"), abs=1e-4)
    assert read["body_names"][0] == "muscles/muscle"
    assert read["body_ends"][-1] == len(read["template"])
    assert read["cells_1"].max() < read["body_ends"][1] - read["body_ends"][0]


def test_its_joints_have_residual_motions_and_two_axes(reader: dict) -> None:
    made = five_fingers.rig()
    fast = FastSkeleton.of(made)
    angles = np.random.default_rng(4).uniform(-0.4, 1.2, len(made.angle_names))
    read = {f"joint_{name}": value for name, value in fast.joints._asdict().items()}
    assert reader["bone_motions"](read, angles) == pytest.approx(fast.motions(angles), abs=1e-9)
