"""The judgement of drawn seeds, on three small bones side by side."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.trust.seeds import RIGHT, Drawn, drawn_seeds, figures, judged

sys.path.insert(0, str(Path(__file__).parents[1] / "imaging"))
from phalanx import grid_points, voxelised
from slim_bone import SlimBone

BONE = SlimBone(length=26.0, canal=3.0)
PLACES = np.array([[0.0, 0.0, 0.0], [0.0, 13.0, 0.0], [0.0, -13.0, 0.0]])


def intensity(points):
    value = np.full(points.shape[:-1], 0.45)
    for place in PLACES:
        value = np.where(BONE.bone(points - place), BONE.intensity(points - place), value)
    return value


@pytest.fixture(scope="module")
def image():
    volume = voxelised(intensity, np.array([-16.0, -21.0, -8.0]), np.array([16.0, 21.0, 8.0]), 0.03, 0, 0.5)
    points = grid_points(volume)
    marrow, whole = np.zeros((2, *volume.shape), np.uint8)
    for label, place in enumerate(PLACES, 1):
        marrow[BONE.marrow(points - place)] = label
        whole[BONE.bone(points - place)] = label
    return volume, marrow, whole


def test_one_draw_of_three_bones_is_right_or_doubted(image) -> None:
    volume, marrow, whole = image
    bones = {f"bone{label}": SimpleNamespace(label=label) for label in (1, 2, 3)}
    dataset = SimpleNamespace(bones=bones, joints={})
    seeds = drawn_seeds(volume, marrow, whole, 0)
    assert set(np.unique(seeds)) == {0, 1, 2, 3, 255}
    assert (marrow[(seeds > 0) & (seeds < 255)] == seeds[(seeds > 0) & (seeds < 255)]).all()
    found = judged(dataset, volume, seeds, marrow)
    assert set(found) == set(bones)
    assert figures(list(found.values()))["seeds_silent"][0] == 0
    assert max(bone.dice for bone in found.values()) > RIGHT


def test_a_wrong_bone_without_a_doubt_is_silent() -> None:
    counted = figures([Drawn(0.97, ""), Drawn(0.5, ""), Drawn(0.5, "short"), Drawn(0.95, "short")])
    assert counted["seed_draws"] == (4.0, "1")
    assert counted["seeds_silent"] == (1.0, "1")
    assert counted["seeds_doubted"] == (2.0, "1")
    assert counted["seeds_false_alarms"] == (1.0, "1")
    assert counted["seed_dice_min"] == (0.5, "1")
