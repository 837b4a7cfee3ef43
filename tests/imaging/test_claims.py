"""Seeds in the wrong place are noticed by how what they claim looks."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from phalanx import Phalanx, capsule, grid_points

from handpipe.core.errors import InputError
from handpipe.imaging.segmentation.claims import (
    appearances,
    doubted,
    load,
    read_looks,
    save,
    segment,
    write_looks,
)
from handpipe.imaging.segmentation.merging import merge
from handpipe.imaging.segmentation.segmentation import (
    BoneProbability,
    SegmentationSettings,
    segment_bone,
)
from handpipe.imaging.volumes.volume import Volume

SETTINGS = SegmentationSettings()
BONES = {"right": 1, "wrong": 2}


@pytest.fixture(scope="module")
def phalanx():
    truth = Phalanx()
    volume = truth.volume()
    return truth, volume, truth.seeds(volume)


def looks_of(volume, seeds):
    found, _ = segment(volume, seeds, BONES, SETTINGS)
    _, merged = merge(volume, {BONES[name]: bone for name, bone in found.items()}, seeds, SETTINGS)
    return appearances(volume, {name: merged[label] for name, label in BONES.items() if label in merged})


@pytest.fixture(scope="module")
def neutral(phalanx):
    """How the right bone looks alone; the other one is as large."""
    _, volume, seeds = phalanx
    look = looks_of(volume, seeds)["right"]
    return {"right": look, "wrong": look}


def test_a_right_bone_is_not_doubted(phalanx, neutral) -> None:
    truth, volume, seeds = phalanx
    look = looks_of(volume, seeds)["right"]
    true_volume = (truth.marrow(grid_points(volume)) < 0).sum() * 0.5**3
    assert look.volume == pytest.approx(true_volume, rel=0.05)
    assert look.enclosed > 0.95
    assert not look.cut_off
    assert doubted({"right": look}, neutral) == {}


def test_seeds_in_muscle(phalanx, neutral, caplog) -> None:
    """Muscle that a person took for marrow: it is darker than marrow around it. The other bone is right."""
    truth, volume, seeds = phalanx
    muscle = np.array(seeds)
    muscle[capsule(grid_points(volume), [-6, 6.5, -3], [6, 6.5, -3]) < 0.5] = 2
    with caplog.at_level(logging.WARNING):
        wrong = doubted(looks_of(volume, muscle), neutral)
    assert set(wrong) == {"wrong"}
    assert "times as bright" in wrong["wrong"]
    assert "wrong: doubted" in caplog.text


def test_seeds_in_darkness_are_refused(phalanx) -> None:
    """As in air or a tendon. The message says so, and other bones are segmented all the same."""
    truth, volume, seeds = phalanx
    dark = np.array(seeds)
    dark[truth.tendon(grid_points(volume)) < -0.8] = 2
    with pytest.raises(InputError, match="darkness"):
        segment_bone(volume, dark, 2, SETTINGS)
    found, wrong = segment(volume, dark, BONES, SETTINGS)
    assert set(found) == {"right"}
    assert "darkness" in wrong["wrong"]


def test_seeds_on_another_bone(phalanx, neutral) -> None:
    """Two bones share one marrow: neither has the size that it has in neutral."""
    _, volume, seeds = phalanx
    shared = np.array(seeds)
    shared[(seeds == 1) & (grid_points(volume)[..., 0] > 0)] = 2
    assert set(doubted(looks_of(volume, shared), neutral)) == {"right", "wrong"}


def test_what_a_person_corrected_is_kept(phalanx, neutral, caplog) -> None:
    _, volume, seeds = phalanx
    shared = np.array(seeds)
    shared[(seeds == 1) & (grid_points(volume)[..., 0] > 0)] = 2
    with caplog.at_level(logging.WARNING):
        assert set(doubted(looks_of(volume, shared), neutral, corrected=["wrong"])) == {"right"}
    assert "wrong: doubted" in caplog.text


def test_files_return_what_they_hold(tmp_path, phalanx, neutral) -> None:
    """Corrected bones take the place of others."""
    _, volume, seeds = phalanx
    found, _ = segment(volume, seeds, {"right": 1}, SETTINGS)
    bone = found["right"]
    save(tmp_path / "bones.h5", {"a": bone, "b": bone})
    smaller = type(bone)(bone.offset + 1, bone.probability[1:, 1:, 1:])
    save(tmp_path / "b.h5", {"b": smaller})
    again = load(tmp_path / "bones.h5", [tmp_path / "b.h5"])
    np.testing.assert_array_equal(again["a"].probability, bone.probability)
    np.testing.assert_array_equal(again["b"].offset, smaller.offset)
    write_looks(tmp_path / "looks.json", neutral, {"b": "why"})
    assert read_looks(tmp_path / "looks.json") == (neutral, {"b": "why"})


def test_a_bone_of_few_voxels_may_differ_by_its_border() -> None:
    """A third of a voxel at the border of a ball of radius 3.4 voxels is 29 % of it, of 10 voxels 10 %."""
    for radius, share in ((3.4, 1 / 3.4), (10.0, 1 / 10.0)):
        grid = np.indices((25, 25, 25)) - 12.0
        ball = np.linalg.norm(grid, axis=0) < radius
        values = np.where(ball, 1.0, 0.0).astype(np.float32)
        bone = BoneProbability(np.zeros(3, np.int64), values)
        neutral = appearances(Volume(values, np.diag([0.5, 0.5, 0.5, 1.0])), {"ball": bone})["ball"]
        assert neutral.border == pytest.approx(share, rel=0.1)
        allowed = max(0.2, neutral.border)
        for change in (0.95 * allowed, -0.95 * allowed):
            assert replace(neutral, volume=(1 + change) * neutral.volume).doubts(neutral) == []
        (doubt,) = replace(neutral, volume=(1 + 1.05 * allowed) * neutral.volume).doubts(neutral)
        assert "volume" in doubt
