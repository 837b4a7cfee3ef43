"""What the benchmark of frames counts, on frames whose faults are known."""

from itertools import islice

import numpy as np
import pytest
from benchmarks.trust.frames import Tried, apart, curled, figures, jumps, path
from tests.fem.bodies import box

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame, Shape

REST, TETS = box((2.0, 1.0, 1.0), (2, 1, 1))
LIMITS = {"MP2_flexion": (-0.2, 1.5), "MP2_abduction": (-0.3, 0.2)}


def _solved(vertices, unsettled=0.0):
    tets = Shape(REST, vertices, TETS, figures={"unsettled": unsettled})
    return {"fat": {"skin": Shape(REST, vertices, TETS[:, :3]), "fat_mesh": tets}}


def test_inverted_tets_are_counted_from_positions_alone():
    pushed = REST.copy()
    pushed[0] += 3.0
    edges = pushed[TETS[:, 1:]] - pushed[TETS[:, :1]]
    volumes = np.einsum("mi,mi->m", np.cross(edges[:, 0], edges[:, 1]), edges[:, 2])
    tried = Tried()
    tried.take(Frame("good", {}, {}), lambda frame: _solved(1.1 * REST))
    assert tried.inverted == 0 and tried.least == pytest.approx(1.331)
    tried.take(Frame("bad", {}, {}), lambda frame: _solved(pushed, unsettled=1.0))
    assert tried.inverted == (volumes < 0).sum() > 0
    assert tried.unsettled == 1 and tried.least < 0


def test_a_refusal_is_logged_and_leaves_a_gap(caplog):
    def refuse(frame):
        raise ConvergenceError("fat of bad", "1 of 6 tets are inverted")

    tried = Tried()
    for solve in (lambda frame: _solved(REST), refuse, lambda frame: _solved(REST)):
        tried.take(Frame("bad", {}, {}), solve)
    found = figures(Tried(), tried)
    assert found["frames"] == (3.0, "1") and found["frames_refused"] == (1.0, "1")
    assert found["frames_jump_max"] == (0.0, "mm")
    assert "1 of 6 tets are inverted" in caplog.text


def test_a_jump_is_a_second_difference():
    steady = [REST + [0.7 * i, 0.0, 0.0] for i in range(5)]
    assert jumps(steady) == pytest.approx(0.0, abs=1e-12)
    steady[2] = steady[2] + np.where(np.arange(len(REST)) == 3, 0.4, 0.0)[:, None] * [0.0, 1.0, 0.0]
    assert np.flatnonzero(jumps(steady) > 0.5).tolist() == [3]
    assert jumps(steady)[3] == pytest.approx(0.8)


def test_poses_stay_within_limits():
    poses = [*islice(curled(LIMITS), 50), *path({"MP2_flexion": 1.3, "MP2_abduction": 0.1}, LIMITS, 20)]
    for pose in poses:
        for name, (lower, upper) in LIMITS.items():
            assert lower <= pose[name] <= upper
    assert min(pose["MP2_flexion"] for pose in poses[:50]) >= 0.75
    steps = np.diff([pose["MP2_flexion"] for pose in poses[50:]])
    assert np.degrees(steps[:11]) == pytest.approx(1.0) and steps[-1] == 0.0


def test_poses_with_colliding_bones_are_passed_over_and_counted():
    poses = ({"MP2_flexion": float(i)} for i in range(100))
    found, rejected = apart(poses, 3, lambda pose: pose["MP2_flexion"] % 2 == 0)
    assert [pose["MP2_flexion"] for pose in found] == [1.0, 3.0, 5.0]
    assert rejected == 3
