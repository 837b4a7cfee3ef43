"""The benchmarks of shapes run at small sizes, and what they call truth is what it says."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.shapes import solves
from benchmarks.shapes.__main__ import main
from benchmarks.shapes.bodies import bar, farthest

from handpipe.core import metrics


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> metrics.Metrics:
    output: Path = tmp_path_factory.mktemp("quick") / "shapes.json"
    main(["string", "solves", "seventeen", "--quick", "--output", str(output), "--threads", "1"])
    return metrics.read(output)


@pytest.mark.slow
def test_slopes_of_the_string(figures: metrics.Metrics) -> None:
    assert figures["string_slope_error"][0] < 0.05
    assert figures["string_overshoot"][0] < figures["string_overshoot_variational_3"][0]


@pytest.mark.slow
def test_all_three_solves_arrive_at_the_same_step(figures: metrics.Metrics) -> None:
    assert figures["solve_iteration_difference"][0] < solves.NEAR
    assert figures["solve_plain_difference"][0] < solves.NEAR


@pytest.mark.slow
def test_muscles_of_several_poses_are_apart_and_their_strains_moderate(figures: metrics.Metrics) -> None:
    assert figures["seventeen_penetration_stage2"][0] < 0.001
    assert figures["seventeen_distance_max"][0] < 0.5
    assert figures["seventeen_eigenvalue_min"][0] > 0.1
    assert figures["seventeen_eigenvalue_max"][0] < 3.0


def test_bars_fill_their_box() -> None:
    mesh = bar((4, 2, 3), (8.0, 2.0, 3.0))
    assert mesh.volumes().sum() == pytest.approx(48.0)
    assert mesh.volumes().min() > 0


def test_farthest_points_are_spread() -> None:
    line = np.zeros((101, 3))
    line[:, 0] = np.arange(101)
    assert sorted(farthest(line, 3)[:, 0]) == [0.0, 50.0, 100.0]
