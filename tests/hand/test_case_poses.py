"""The shared case's frames of the embedded hand are read as they stand, within the limits of its joints."""

import csv
from pathlib import Path

import numpy as np
import pytest

from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.errors import InputError
from handpipe.hand.subject import joint_limits
from handpipe.skeleton.drivers.scene_frames import frame_names
from handpipe.skeleton.joints.angles import read_angles

ROOT = Path(__file__).parents[2]
CASE = ROOT.parent / "shared" / "cases" / "poses" / "poses.csv"

pytestmark = pytest.mark.skipif(not CASE.is_file(), reason="the shared cases are not beside the checkout")


@pytest.fixture(scope="module")
def limits() -> dict[str, tuple[float, float]]:
    return joint_limits(load_dataset(ROOT / "config/datasets/phantom-hand-preview.yaml"))


def test_every_frame_is_within_the_limits_of_the_joints(limits: dict[str, tuple[float, float]]) -> None:
    with CASE.open(encoding="utf-8", newline="") as file:
        rows = {row.pop("frame"): row for row in csv.DictReader(file)}
    assert frame_names(CASE, limits) == [*rows] == ["fist4", "three", "fine0", "fine1", "fine2", "closing"]
    for name, angles in read_angles(CASE, limits).items():
        expected = {key.removesuffix(" [deg]"): np.radians(float(value)) for key, value in rows[name].items()}
        assert angles == pytest.approx(expected, abs=1e-12)
        assert all(limits[a][0] <= value <= limits[a][1] for a, value in angles.items())


def test_the_frame_beyond_a_limit_is_named(limits: dict[str, tuple[float, float]]) -> None:
    narrow = limits | {"PIP4_flexion": (limits["PIP4_flexion"][0], np.radians(80.0))}
    with pytest.raises(InputError, match=r"three.*PIP4_flexion.* 88 deg is outside its limits"):
        frame_names(CASE, narrow)
