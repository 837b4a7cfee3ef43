"""The benchmark of levels: errors of a known displacement, coverage, seconds, table and picture."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.levels import measured
from benchmarks.levels.document import main, table
from tests.levels.three_bones import random_frames, rig

from handpipe.core import metrics
from handpipe.levels import LearnedHand, TrainingSet, learn


@pytest.fixture(scope="module")
def hand() -> LearnedHand:
    return learn(random_frames(30), rig())


@pytest.fixture(scope="module")
def tested() -> TrainingSet:
    return TrainingSet.of(random_frames(6, seed=8))


def test_errors_are_the_distances_of_the_vertices(hand: LearnedHand, tested: TrainingSet) -> None:
    """Frames that are moved by 3 mm from what the hand gives."""
    bodies = dict(tested.bodies)
    given = [hand.split(hand.moved(m, a, "L1")) for m, a in zip(tested.motions, tested.angles, strict=True)]
    for body, shape in tested.bodies.items():
        bodies[body] = replace(shape, vertices=np.stack([x[body] for x in given]) + [0, 3, 0])
    found = measured._errors(hand, replace(tested, bodies=bodies), "L1")
    for name in ("skin", "muscles"):
        assert found[f"l1_{name}_error_mean"] == (pytest.approx(3.0, rel=1e-5), "mm")
        assert found[f"l1_{name}_error_max"] == (pytest.approx(3.0, rel=1e-5), "mm")
    assert measured._bounds(hand, replace(tested, bodies=bodies))["l1_covered"][0] == 0.0


def test_most_frames_are_within_the_stated_errors(hand: LearnedHand, tested: TrainingSet) -> None:
    found = measured._bounds(hand, tested)
    assert found["covered_expected"][0] == pytest.approx(6 / 7)
    assert found["l1_covered"][0] >= 0.5


def test_seconds_are_of_the_bodies_that_are_asked_for(hand: LearnedHand, tested: TrainingSet) -> None:
    found = measured.seconds(hand, tested.angles)
    assert found["vertices_skin"][0] == len(hand.bodies["fat", "skin"].rest)
    assert found["vertices_everything"][0] == len(hand.rest)
    assert 0 < found["l0_skin_seconds"][0] < 0.1


def test_table_and_picture(tmp_path: Path) -> None:
    found: metrics.Metrics = {"hand_simulated_seconds": (9.0, "s")}
    for level in ("l0", "l1"):
        for what in ("skin", "organs", "everything"):
            found[f"hand_{level}_{what}_seconds"] = (0.0012, "s")
        for tissue in ("skin", "muscles", "tendons", "tendons_surface", "ligaments"):
            found[f"hand_{level}_{tissue}_error_mean"] = (0.25, "mm")
            found[f"hand_{level}_{tissue}_error_max"] = (2.0, "mm")
    found |= {"hand_l1_skin_error_mean_16": (0.4, "mm"), "hand_l1_skin_error_mean_32": (0.25, "mm")}
    assert "| hand, L1 | 1.20; 1.20; 1.20 | 0.250; 2.0 |" in table(found)
    metrics.write(tmp_path / "levels.json", found)
    main([str(tmp_path / "levels.json"), "--output", str(tmp_path / "levels.png")])
    assert (tmp_path / "levels.png").stat().st_size > 5000
    assert (tmp_path / "levels.md").read_text(encoding="utf-8") == table(found)
