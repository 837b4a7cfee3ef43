"""Random poses lie between the scanned ones, and what came of them is counted."""

import numpy as np
import pytest
from benchmarks.frames.following import followed, uneven
from benchmarks.frames.mixtures import mixtures
from benchmarks.frames.muscles import Result, figures

from handpipe.core import Frame, Shape

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


class _Halving:
    """A skin at twice the angle, which misses an eighth of the way from where it starts."""

    name, needs = "skin", ()

    def solve(self, frame, below):
        return self._near(0.0, frame)

    def solve_after(self, before, frame, below):
        return self._near(before[1]["skin"]["skin"].vertices[0, 0], frame)

    def _near(self, start, frame):
        end = 2 * frame.angles["a"]
        x = np.array([[end + (start - end) / 8, 0.0, 0.0]])
        return {"skin": Shape(x, x, np.zeros((0, 3), int))}


def test_frames_from_the_frame_before_are_compared_with_those_from_their_own_start():
    found = followed([_Halving()], [Frame(str(a), {"a": a}, {}) for a in (1.0, 2.0, 3.0, 4.0)])
    # Alone: 1.75 times the angle. After: 1.75, 3.5 + 1.75 / 8, ...
    after = [1.75]
    for a in (2.0, 3.0, 4.0):
        after.append(1.75 * a + after[-1] / 8)
    apart = np.array(after) - [1.75, 3.5, 5.25, 7.0]
    assert found["skin_apart_max"] == (pytest.approx(apart.max()), "mm")
    assert found["skin_apart_mean"] == (pytest.approx(apart.mean()), "mm")
    assert found["uneven_max"] == (pytest.approx(0.0, abs=1e-12), "mm")
    middles = [after[i] - (after[i - 1] + after[i + 1]) / 2 for i in (1, 2)]
    assert found["uneven_max_after"] == (pytest.approx(np.abs(middles).max()), "mm")
    assert set(found) >= {"frames", "skin_seconds", "skin_seconds_after", "frame_ratio"}


def test_unevenness_is_the_distance_from_the_middle():
    line = [np.array([[0.0, 0.0, 0.0]]), np.array([[1.0, 0.3, 0.0]]), np.array([[2.0, 0.0, 0.0]])]
    assert uneven(line) == pytest.approx(0.3)
