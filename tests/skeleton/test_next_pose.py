"""The order of poses that the design proposes, against random orders, on motions of another formula."""

import numpy as np
import pytest
from five_fingers import DESCRIPTION, random_angles, relative, rig
from manufactured import noisy

from handpipe.skeleton.joints.joints import fit_joint
from handpipe.skeleton.rig.next_pose import RigUncertainty, _information, _sensitivity, plan_poses, rank_poses

RIG = rig(residuals=False)
ZERO = {n: 0.0 for d in DESCRIPTION for n in d[3]}
CENTROIDS = {j.name: RIG.surfaces[j.child].vertices.mean(axis=0) for j in RIG.joints}


def candidates():
    """Large and small poses, whole fists and single fingers, as one may think of."""
    out = {f"large{i}": random_angles(100 + i, 0.95) for i in range(5)}
    out |= {f"small{i}": random_angles(200 + i, 0.2) for i in range(5)}
    for digit in "12345":
        pose = random_angles(300 + int(digit), 0.9)
        out[f"finger{digit}"] = {n: a * (digit in n) for n, a in pose.items()}
    out["fist"] = {n: (upper if n.endswith("flexion") else 0.0) for n, (_, upper) in RIG.limits.items()}
    return out


CANDIDATES = candidates()


def true_error(poses, seed):
    """Root mean square in mm over every other joint and its range, fitted to noisy scans of the poses."""
    rng, squares = np.random.default_rng(seed), []
    for joint in RIG.joints[::2]:
        scans = [
            noisy(relative(joint.name, [p[n] for n in joint.angles]), rng, 0.3, 0.1, at=CENTROIDS[joint.name])
            for p in poses
        ]
        # Axes and centre are guessed 15 degrees and 3 mm off: what no pose tells stays there.
        hints = joint.fit.axes.directions + 0.25 * rng.normal(size=(joint.fit.dof, 3)) / np.sqrt(3)
        fit = fit_joint(scans, joint.fit.dof, hints, near=joint.fit.centre + rng.normal(scale=1.7, size=3))
        for values in rng.uniform(*joint.limits.T, size=(8, joint.fit.dof)):
            unseen = relative(joint.name, values)
            turn, shift = fit.errors([unseen], CENTROIDS[joint.name])
            squares.append(shift[0] ** 2 + (12.0 * turn[0]) ** 2)
    return np.sqrt(np.mean(squares))


def test_following_the_ranking_beats_random_orders():
    start = {"small": random_angles(1, 0.3)}
    known = RigUncertainty.of_rig(RIG, start)
    planned = [name for name, _ in plan_poses(known, CANDIDATES, 4)]
    rng = np.random.default_rng(0)
    orders = [list(rng.permutation(list(CANDIDATES)))[:4] for _ in range(10)]
    for count in (2, 4):
        ours = np.mean(
            [true_error([*start.values(), *(CANDIDATES[n] for n in planned[:count])], s) for s in range(4)]
        )
        theirs = [
            true_error([*start.values(), *(CANDIDATES[n] for n in order[:count])], s)
            for s, order in enumerate(orders)
        ]
        assert ours < 0.8 * np.mean(theirs)
        assert ours < np.median(theirs)


def test_the_expected_error_falls_with_every_pose_and_orders_as_the_true_one():
    known = RigUncertainty.of_rig(RIG, {})
    plan = plan_poses(known, CANDIDATES, 5)
    errors = [known.error, *(e for _, e in plan)]
    assert all(a > b for a, b in zip(errors[:-1], errors[1:], strict=True))
    single = rank_poses(known, CANDIDATES)
    assert single[0][0].startswith(("large", "fist")) and single[-1][0].startswith(("small", "finger"))


def test_a_pose_at_neutral_tells_nothing():
    known = RigUncertainty.of_rig(RIG, {})
    assert known.after(ZERO).error == pytest.approx(known.error, rel=1e-9)
    one = known.after(CANDIDATES["finger2"])
    before, after = known.by_joint(), one.by_joint()
    assert after["PIP2"] < 0.7 * before["PIP2"] and after["PIP4"] == pytest.approx(before["PIP4"], rel=1e-9)


@pytest.mark.parametrize("name", ["MP3", "PIP4"])
def test_the_linear_model_agrees_with_a_changed_joint(name):
    """Tilting the true axes and moving the true centre moves bones as the sensitivities say."""
    from manufactured import motion
    from scipy.spatial.transform import Rotation

    joint = next(j for j in RIG.joints if j.name == name)
    values, point = np.array([0.7, 0.2])[: joint.fit.dof], CENTROIDS[name]
    parameters, angles = _sensitivity(joint, values, point)
    axes, centre, h = joint.fit.axes.directions, joint.fit.centre, 1e-6

    def moved(tilt, shift, turned):
        return motion(Rotation.from_rotvec(tilt).apply(axes), centre + shift, turned)

    rest = moved(np.zeros(3), np.zeros(3), values)
    for k in range(3):
        for column, there in (
            (parameters[:, k], moved(h * np.eye(3)[k], np.zeros(3), values)),
            (parameters[:, 3 + k], moved(np.zeros(3), h * np.eye(3)[k], values)),
        ):
            turn = Rotation.from_matrix(there.rotation @ rest.rotation.T).as_rotvec() / h
            assert np.allclose(column[:3], turn, atol=1e-5)
            assert np.allclose(column[3:], (there(point) - rest(point)) / h, atol=1e-4)
    for k in range(joint.fit.dof):
        there = moved(np.zeros(3), np.zeros(3), values + h * np.eye(joint.fit.dof)[k])
        turn = Rotation.from_matrix(there.rotation @ rest.rotation.T).as_rotvec() / h
        assert np.allclose(angles[:3, k], turn, atol=1e-5)
        assert np.allclose(angles[3:, k], (there(point) - rest(point)) / h, atol=1e-4)
    # What a change of angle explains tells nothing of the parameters.
    told = _information(joint, values, point, RigUncertainty.of_rig(RIG, {}).knowledge)
    assert np.linalg.matrix_rank(told, tol=1e-6) == 6 - joint.fit.dof


def test_a_mirrored_hand_has_the_same_plan():
    plans = [
        plan_poses(RigUncertainty.of_rig(rig(False, mirrored), {}), CANDIDATES, 4)
        for mirrored in (False, True)
    ]
    assert [n for n, _ in plans[0]] == [n for n, _ in plans[1]]
    assert [e for _, e in plans[0]] == pytest.approx([e for _, e in plans[1]], rel=1e-4)
