import numpy as np
import pytest
from manufactured import motion, noisy, unit

from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joints import fit_joint
from handpipe.skeleton.joints.residual import Residual, fit_residual, fit_ridge

HINGE = unit([0.1, 0.97, -0.15])
SECOND = unit(np.cross(np.cross(HINGE, [0.2, 0.1, 1.0]), HINGE))
CENTRE = np.array([42.0, 3.0, -5.0])
PHI = np.radians([-15, 20, 45, 70, 95])
PAIRS = np.radians([[15, 12], [40, -10], [75, 3], [80, -4], [-15, 15], [30, 0]])


def test_one_axis_and_centre_are_recovered_exactly():
    poses = [motion([HINGE], CENTRE, [phi]) for phi in PHI]
    fit = fit_joint(poses, 1, [[0, 1, 0]], near=CENTRE + 2 * HINGE)
    assert np.allclose(fit.axes.directions[0], HINGE, atol=1e-8)
    assert np.allclose(fit.angles[:, 0], PHI, atol=1e-8)
    # A hinge does not tell where along its axis the centre is: there it stays near the given point.
    assert np.allclose(fit.centre, CENTRE + 2 * HINGE, atol=1e-6)


def test_two_axes_and_centre_are_recovered_exactly():
    poses = [motion([HINGE, SECOND], CENTRE, pair) for pair in PAIRS]
    fit = fit_joint(poses, 2, [[0, 1, 0], [0, 0, 1]])
    assert np.allclose(fit.axes.directions, [HINGE, SECOND], atol=1e-8)
    assert np.allclose(fit.angles, PAIRS, atol=1e-7)
    assert np.allclose(fit.centre, CENTRE, atol=1e-6)


def test_hints_fix_the_signs():
    poses = [motion([HINGE, SECOND], CENTRE, pair) for pair in PAIRS]
    fit = fit_joint(poses, 2, [[0, -1, 0], [0, 0, -1]])
    assert np.allclose(fit.axes.directions, [-HINGE, -SECOND], atol=1e-8)
    assert np.allclose(fit.angles, -PAIRS, atol=1e-7)


def test_axis_error_under_noise_has_the_size_of_the_noise():
    rng = np.random.default_rng(3)
    tilts, shifts = [], []
    for _ in range(30):
        poses = [noisy(motion([HINGE], CENTRE, [phi]), rng, 0.5, 0.1, at=CENTRE) for phi in PHI]
        fit = fit_joint(poses, 1, [[0, 1, 0]], near=CENTRE)
        tilts.append(np.degrees(np.arccos(min(1, fit.axes.directions[0] @ HINGE))))
        shifts.append(np.linalg.norm(fit.centre - CENTRE))
    # A quaternion's vector part has half the noise and length sin(phi/2); two directions tilt the axis.
    expected = 0.5 / 2 / np.sqrt((np.sin(PHI / 2) ** 2).sum()) * np.sqrt(2)
    assert 0.6 * expected < np.sqrt(np.mean(np.square(tilts))) < 1.5 * expected
    assert np.mean(shifts) < 0.2


def test_closed_form_angles_are_the_best_angles():
    rng = np.random.default_rng(0)
    axes = np.array([HINGE, SECOND])
    rotations = np.array([noisy(motion(axes, CENTRE, p), rng, 5.0, 0).rotation for p in PAIRS])

    def mismatch(angles, rotation):
        return RigidTransform(Axes(axes, (0, 1)).rotation(angles), CENTRE).angle_to(
            RigidTransform(rotation, CENTRE)
        )

    for angles, rotation in zip(Axes(axes, (0, 1)).nearest(rotations), rotations, strict=True):
        least = mismatch(angles, rotation)
        assert least > 0.001
        for step in 1e-3 * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, 1]]):
            assert mismatch(angles + step, rotation) > least


def gliding(phi):
    """Residuals orthogonal to the hinge, as the axis fit leaves them, and at most 4 deg and 0.6 mm."""
    side = unit(np.cross(HINGE, [1, 0, 0]))
    return 0.03 * np.array(phi**2 - 0.8 * phi) * side, 0.3 * np.array([phi**2, 0.2 * phi, -0.5 * phi**2])


def test_quadratic_residuals_predict_unseen_poses_better_than_a_fixed_hinge():
    def pose(phi):
        return motion([HINGE], CENTRE, [phi], *gliding(phi))

    fit = fit_joint([pose(p) for p in np.radians([-15, 10, 30, 50, 70, 95])], 1, [[0, 1, 0]], near=CENTRE)
    unseen = [pose(p) for p in np.radians([0, 20, 40, 60, 85])]
    full = fit.errors(unseen, np.array([60.0, 0, 0]), "full")
    partial = fit.errors(unseen, np.array([60.0, 0, 0]), "partial")
    assert full[0].mean() < 0.1 * partial[0].mean()
    assert full[1].mean() < 0.1 * partial[1].mean()


def test_noise_alone_teaches_no_large_residual():
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(10):
        poses = [noisy(motion([HINGE], CENTRE, [p]), rng, 0.3, 0.1, at=CENTRE) for p in PHI]
        fit = fit_joint(poses, 1, [[0, 1, 0]], near=CENTRE)
        truth = [motion([HINGE], CENTRE, [p]) for p in np.radians([10, 35, 60, 80])]
        full, partial = (np.mean(fit.errors(truth, CENTRE, m)[1]) for m in ("full", "partial"))
        ratios.append(full - partial)
    assert np.mean(ratios) < 0.03


@pytest.mark.parametrize("dof", [1, 2])
def test_neutral_is_the_identity(dof):
    rng = np.random.default_rng(1)
    axes = [HINGE, SECOND][:dof]
    poses = [noisy(motion(axes, CENTRE, p[:dof]), rng, 2.0, 0.5) for p in PAIRS]
    fit = fit_joint(poses, dof, np.eye(3)[1 : 1 + dof])
    neutral = fit.transform(np.zeros(dof))
    assert np.allclose(neutral.rotation, np.eye(3), atol=1e-14) and np.allclose(
        neutral.translation, 0, atol=1e-12
    )


@pytest.mark.parametrize("terms", [(0, 1), (0, 1, 2, 3, 4)])
def test_residual_functions_reproduce_quadratics(terms):
    rng = np.random.default_rng(2)
    dof = 1 if len(terms) == 2 else 2
    angles = rng.uniform(-0.5, 1.5, size=(9, dof))
    truth = Residual(rng.normal(size=(len(terms), 3)), angles.min(axis=0), angles.max(axis=0))
    fit = fit_ridge(angles, truth(angles), terms, 0.0)
    inside = np.clip(rng.uniform(-0.5, 1.5, size=(20, dof)), truth.lower, truth.upper)
    assert np.allclose(fit(inside), truth(inside), atol=1e-9)


@pytest.mark.parametrize("dof", [1, 2])
def test_extrapolation_is_tangent(dof):
    rng = np.random.default_rng(4)
    residual = Residual(rng.normal(size=(2 if dof == 1 else 5, 3)), np.full(dof, -0.3), np.full(dof, 1.1))
    h = 1e-5

    def slope(x, direction):
        return (residual(x + h * direction)[0] - residual(x - h * direction)[0]) / (2 * h)

    for axis in range(dof):
        for end in (-0.3, 1.1):
            x = rng.uniform(-0.2, 1.0, size=dof)
            if dof == 2:
                x[1 - axis] = 1.6  # beyond the other angle's range as well
            x[axis] = end
            e = np.eye(dof)[axis]
            out = e * np.sign(end)
            for along in np.eye(dof):
                assert np.allclose(slope(x - 2 * h * out, along), slope(x + 2 * h * out, along), atol=1e-3)
            # Beyond its range each angle acts linearly.
            values = [residual(x + k * out)[0] for k in (0.1, 0.5, 0.9)]
            assert np.allclose(values[0] - 2 * values[1] + values[2], 0, atol=1e-12)


def test_a_joint_that_hardly_moves_takes_its_hint():
    poses = [motion([HINGE], CENTRE, [1e-7]), motion([HINGE], CENTRE, [-1e-7])]
    fit = fit_joint(poses, 1, [[0, 0, 1]], near=CENTRE)
    assert np.allclose(fit.axes.directions[0], [0, 0, 1], atol=1e-3)
    assert np.allclose(fit.centre, CENTRE)


def test_few_poses_say_nothing_of_pairs_of_angles_that_they_lack():
    """Six poses, and a pair of angles far from theirs: the function stays near what it has seen."""
    pairs = np.radians([[66, 6], [6, -6], [-24, -1], [-8, -11], [34, 0], [68, 10]])
    far, direction, worst = np.radians([69, -12]), np.array([1.0, 0.5, -0.3]), []
    for seed in range(30):
        noise = 0.004 * np.random.default_rng(seed).normal(size=(6, 3))
        samples = 0.05 * np.outer(np.sin(2 * pairs[:, 0]), direction) + noise
        true = 0.05 * np.sin(2 * far[0]) * direction
        worst.append(np.abs(fit_residual(pairs, samples)(far)[0] - true).max())
    assert np.max(worst) < 0.05 and np.mean(worst) < 0.012
