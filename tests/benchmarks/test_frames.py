"""Random poses lie between the scanned ones, and what came of them is counted."""

import numpy as np
import pytest
from benchmarks.frames.mixtures import mixtures
from benchmarks.frames.muscles import Result, figures

SCANNED = {"bent": {"a": 1.0, "b": 0.0}, "turned": {"a": 0.0, "b": 2.0}}


@pytest.mark.parametrize("reach", [1.0, 1.3])
def test_mixtures_lie_in_the_triangle_of_the_scanned_poses_and_neutral(reach):
    shares = np.array([[pose["a"], pose["b"] / 2.0] for pose in mixtures(SCANNED, 200, 3, reach)])
    assert shares.min() >= 0 and shares.sum(axis=1).max() <= reach
    assert shares.sum(axis=1).max() > 0.95 * reach and shares.max(axis=0).min() > 0.9 * reach
    assert mixtures(SCANNED, 5, 3) == mixtures(SCANNED, 5, 3) != mixtures(SCANNED, 5, 4)


def test_a_pose_without_result_is_counted_and_no_mean_is_taken_of_it():
    rests, creeps = Result(3.0, 0.01, 0.02, 5.0), Result(20.0, 0.2, 0.1, 15.0)
    failed = Result(20.0, np.inf, np.inf, 99.0)
    found = figures([rests, creeps, failed])
    assert [found[f"poses{kind}"][0] for kind in ("", "_failed", "_at_rest")] == [3, 1, 1]
    assert found["seconds_mean"] == (10.0, "s") and found["overlap_max"] == (0.1, "mm")
    assert figures([failed])["poses_failed"] == (1.0, "1")
