"""What the benchmark of frames counts, on frames whose faults are known."""

from itertools import islice

import numpy as np
import pytest
from benchmarks.trust.frames import Tried, figures, jumps
from benchmarks.trust.poses import CHUNKS, COUNT, curled, passed_over, path, poses_of
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
    def collide(pose):
        return round(1e6 * pose["MP2_flexion"]) % 2 == 0

    scanned = {"bent": {"MP2_flexion": 1.0, "MP2_abduction": 0.1}}
    found = {
        kind: {
            n: p
            for c in CHUNKS
            if c.startswith(kind)
            for n, p in poses_of(c, scanned, LIMITS, collide).items()
        }
        for kind in COUNT
    }
    assert {kind: len(poses) for kind, poses in found.items()} == COUNT
    outside = list(found["outside"].values())
    assert outside == list(islice((p for p in curled(LIMITS) if not collide(p)), COUNT["outside"]))
    all_of = list(
        islice(curled(LIMITS), COUNT["outside"] + passed_over(curled(LIMITS), COUNT["outside"], collide))
    )
    assert all_of[-1] == outside[-1] and sum(map(collide, all_of)) == len(all_of) - len(outside) > 0


def test_chunks_are_read_as_they_were_solved(tmp_path):
    def solve(frame):
        if frame.name == "refused":
            raise ConvergenceError("fat of refused", "no equilibrium")
        return _solved(float(frame.name) * REST, unsettled=1.0)

    files = [tmp_path / f"path{i}.npz" for i in range(2)]
    for file, names in zip(files, (["1.0", "refused"], ["1.1"]), strict=True):
        tried = Tried()
        for name in names:
            tried.take(Frame(name, {}, {}), solve)
        tried.write(file)
    together = Tried.read(files)
    assert [None if s is None else s[-1, 0] / REST[-1, 0] for s in together.skins] == [1.0, None, 1.1]
    assert (together.refused, together.unsettled, len(together.seconds)) == (1, 2, 3)
    assert together.least == pytest.approx(1.0)
