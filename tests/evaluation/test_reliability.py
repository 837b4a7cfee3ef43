"""Whether stated deviations hold, on errors that are drawn with known ones."""

import numpy as np
import pytest

from handpipe.evaluation import coverage, reliability_metrics, reliability_rows


def drawn(factor: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    true = rng.uniform(0.1, 1.0, 40000)
    return np.abs(true * rng.normal(size=40000)), factor * true


def test_normal_errors_are_within_one_and_two_deviations_as_often_as_they_should() -> None:
    errors, stated = drawn()
    assert coverage(errors, stated, 1.0) == pytest.approx(0.683, abs=0.01)
    assert coverage(errors, stated) == pytest.approx(0.954, abs=0.005)
    assert coverage(*drawn(0.5)) == pytest.approx(0.683, abs=0.01)


def test_metrics_tell_sizes_and_ranks() -> None:
    errors, stated = drawn()
    found = reliability_metrics(errors, stated, "heldout_skin")
    assert found["error_heldout_skin"][0] == pytest.approx(found["stated_heldout_skin"][0], rel=0.02)
    assert 0.3 < found["rank_correlation_heldout_skin"][0] < 0.7
    shuffled = reliability_metrics(errors, np.random.default_rng(0).permutation(stated), "all")
    assert abs(shuffled["rank_correlation_all"][0]) < 0.02
    alike = reliability_metrics(errors, np.ones_like(stated), "all")
    assert "rank_correlation_all" not in alike


def test_groups_go_from_small_to_large_deviations_and_hold_all_points() -> None:
    errors, stated = drawn()
    rows = reliability_rows(errors, stated)
    assert [row["group"] for row in rows] == list(range(1, 11))
    for row in rows:
        assert row["error"] == pytest.approx(row["stated"], rel=0.06)
        assert row["coverage"] == pytest.approx(0.954, abs=0.015)
    assert (np.diff([float(row["stated"]) for row in rows]) > 0).all()
    squares = np.mean([float(row["error"]) ** 2 for row in rows])
    assert squares == pytest.approx(np.mean(errors**2))
