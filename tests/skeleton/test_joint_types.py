"""Saddle and ball joints: recovered from motions of known type, and chosen where these earn them."""

import numpy as np
import pytest
from manufactured import noisy, turn, unit

from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.joints.joint_types import choose_type, fit_best
from handpipe.skeleton.joints.joints import fit_joint

A, B = unit([0.1, 0.97, -0.15]), unit([0.45, -0.1, 0.9])
OBLIQUE = unit([0.3, 0.5, 0.8])  # 63 degrees from A
CENTRE, SECOND = np.array([42.0, 3.0, -5.0]), np.array([47.0, 1.5, -2.0])
POINT = np.array([60.0, 2, -4])
HINTS = np.array([[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]])
RNG = np.random.default_rng(1)
TRIPLES = np.radians(RNG.uniform([-20, -25, -30], [80, 25, 30], size=(12, 3)))


def hinge(q):
    return RigidTransform.about(CENTRE, turn(q[0] * A))


def universal(q):
    across = unit(np.cross(np.cross(A, B), A))
    return RigidTransform.about(CENTRE, turn(q[0] * A) @ turn(q[1] * across))


def saddle(q):
    """The first axis stands in the parent, the second in the child: two turns about two lines."""
    return RigidTransform.about(CENTRE, turn(q[0] * A)) @ RigidTransform.about(SECOND, turn(q[1] * OBLIQUE))


def ball(q):
    return RigidTransform.about(CENTRE, turn(q[0] * A) @ turn(q[1] * B) @ turn(q[2] * unit([1, 0.2, 0.1])))


def scans(motion, count=8, seed=None):
    rng = np.random.default_rng(seed)
    poses = [motion(q) for q in TRIPLES[:count]]
    return poses if seed is None else [noisy(p, rng, 0.2, 0.07, at=POINT) for p in poses]


def worst(fit, motion, model="full"):
    rotation, shift = fit.errors([motion(q) for q in TRIPLES[8:]], POINT, model)
    return np.degrees(rotation).max(), shift.max()


def test_a_saddle_is_recovered_exactly():
    fit = fit_joint(scans(saddle), 2, HINTS[:2], near=CENTRE + [1, -1, 2], joint_type="saddle")
    assert fit.type == "saddle" and fit.axes.order == (0, 1)
    assert np.allclose(fit.axes.directions, [A, OBLIQUE], atol=1e-6)
    assert np.allclose(fit.angles, TRIPLES[:8, :2], atol=1e-6)
    # The axes are lines: the offset is their common perpendicular.
    across = unit(np.cross(A, OBLIQUE))
    assert np.allclose(fit.offset, ((SECOND - CENTRE) @ across) * across, atol=1e-5)
    assert max(worst(fit, saddle, "partial")) < 1e-4
    orthogonal = fit_joint(scans(saddle), 2, HINTS[:2], near=CENTRE)
    assert worst(orthogonal, saddle, "partial")[0] > 0.5


def test_a_ball_is_recovered_exactly():
    fit = fit_joint(scans(ball), 3, HINTS, near=CENTRE + [2, -1, 2])
    assert fit.type == "ball" and np.allclose(fit.centre, CENTRE, atol=1e-6)
    assert np.allclose(fit.axes.directions @ fit.axes.directions.T, np.eye(3), atol=1e-9)
    # A ball has no axes of its own: the hints' are taken, so that angles mean what a person named.
    assert np.allclose(fit.axes.directions, HINTS)
    for found, q in zip(fit.angles, TRIPLES, strict=False):
        turned = turn(found[0] * HINTS[0]) @ turn(found[1] * HINTS[1]) @ turn(found[2] * HINTS[2])
        assert np.allclose(turned, ball(q).rotation, atol=1e-9)
    assert max(worst(fit, ball, "partial")) < 1e-5


@pytest.mark.parametrize("motion", [hinge, universal, saddle, ball])
def test_the_type_of_noisy_motions_is_found(motion):
    chosen, errors = choose_type(scans(motion, 8, 1), HINTS, near=CENTRE, point=POINT)
    assert chosen == motion.__name__, errors


def test_the_best_of_two_angles_keeps_the_simple_joint_unless_it_pays():
    assert fit_best(scans(universal, 8, 3), 2, HINTS[:2], near=CENTRE, point=POINT).type == "universal"
    found = fit_best(scans(saddle, 8, 3), 2, HINTS[:2], near=CENTRE, point=POINT)
    simple = fit_joint(scans(saddle, 8, 3), 2, HINTS[:2], near=CENTRE)
    assert found.type == "saddle"
    assert worst(found, saddle)[0] < 0.6 * worst(simple, saddle)[0]


def test_few_poses_earn_nothing():
    chosen, errors = choose_type(scans(ball, 2, 1), HINTS, near=CENTRE, point=POINT)
    assert chosen == "hinge" and errors["ball"] == np.inf


@pytest.mark.parametrize(("motion", "joint_type"), [(saddle, "saddle"), (ball, "ball")])
@pytest.mark.parametrize("model", ["full", "partial"])
def test_twists_of_the_richer_types_are_derivatives(motion, joint_type, model):
    dof = 2 if joint_type == "saddle" else 3
    fit = fit_joint(scans(motion, 8, 5), dof, HINTS[:dof], near=CENTRE, joint_type=joint_type)
    angles, h = np.array([0.5, -0.3, 0.2])[:dof], 1e-6
    w, v = fit.twists(angles, model)
    here = fit.transform(angles, model)(POINT)
    for k, e in enumerate(np.eye(dof)):
        ahead, back = (fit.transform(angles + s * e, model)(POINT) for s in (h, -h))
        assert np.allclose(np.cross(w[k], here) + v[k], (ahead - back) / (2 * h), atol=1e-6)


@pytest.mark.parametrize("joint_type", ["saddle", "ball"])
def test_neutral_is_the_identity(joint_type):
    dof = 2 if joint_type == "saddle" else 3
    fit = fit_joint(scans(ball, 8, 6), dof, HINTS[:dof], near=CENTRE, joint_type=joint_type)
    neutral = fit.transform(np.zeros(dof))
    assert np.allclose(neutral.rotation, np.eye(3), atol=1e-12)
    assert np.allclose(neutral.translation, 0, atol=1e-12)


@pytest.mark.parametrize(("motion", "joint_type"), [(saddle, "saddle"), (ball, "ball")])
def test_mirrored_motions_give_the_mirrored_joint(motion, joint_type):
    """A mirrored turn is about the mirrored axis the other way round."""
    mirror, dof = np.diag([1.0, -1, 1]), 2 if joint_type == "saddle" else 3
    right = scans(motion, 8, 7)
    left = [RigidTransform(mirror @ t.rotation @ mirror, mirror @ t.translation) for t in right]
    a = fit_joint(right, dof, HINTS[:dof], near=CENTRE, joint_type=joint_type)
    b = fit_joint(left, dof, -HINTS[:dof] @ mirror, near=mirror @ CENTRE, joint_type=joint_type)
    assert np.allclose(b.axes.directions, -a.axes.directions @ mirror, atol=1e-5)
    assert np.allclose(b.angles, a.angles, atol=1e-5)
    assert np.allclose(b.centre, mirror @ a.centre, atol=1e-3)
    assert np.allclose(b.offset, mirror @ a.offset, atol=1e-3)
