"""Errors of a joint measured at the corners of its child's box, for every type of joint."""

import numpy as np
import pytest
from manufactured import motion, noisy, turn, unit
from test_rig import DATASET, FIT, SURFACES, manufactured, uncertain

from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.joints.joint_knowledge import JointKnowledge
from handpipe.skeleton.joints.joints import fit_joint
from handpipe.skeleton.localisation.joint_search import Departure
from handpipe.skeleton.localisation.location_confidence import SURE, LocationConfidence
from handpipe.skeleton.rig.rig import Rig
from handpipe.skeleton.rig.table import ErrorPoints, joint_table

CENTRE = np.array([20.0, 0.5, -1])
HINTS = np.array([[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]])


def ball(q, centre=CENTRE):
    return motion(HINTS, centre, q)


def test_corners_of_a_box():
    surface = SURFACES["middle2"]
    places = ErrorPoints.measure(surface)
    assert np.ptp(places.corners, axis=0) == pytest.approx(np.ptp(surface.vertices, axis=0), rel=0.02)
    assert places.centroid == pytest.approx(surface.vertices.mean(axis=0))


def test_a_ball_joint_has_errors_of_places_and_none_of_rotations():
    """Its rotations are those of the poses, however wrong: only places can be off."""
    joint = DATASET.joints["MP2"].model_copy(
        update={"angles": ("A", "B", "C"), "axis_hints": tuple(map(tuple, HINTS)), "limits_deg": None}
    )
    dataset = DATASET.model_copy(update={"joints": DATASET.joints | {"MP2": joint}})
    transforms = manufactured(degrees=0.3, mm=0.3)
    rig = Rig.fit(dataset, transforms, SURFACES, FIT, uncertain(transforms, 0.3, 0.3))
    table = joint_table(rig, dataset, transforms, FIT)
    row = table.rows[0]
    assert row["type"] == "ball" and not any(key.endswith("_R") for key in row)
    assert row["FM_p"] > 0.05 and row["loo_FM_p"] > row["FM_p"]
    assert "rotation_error_MP2" not in table.metrics and table.metrics["loo_place_error_MP2"][0] > 0.1
    hinge = table.rows[1]
    # A turn moves a corner by its arm: places tell rotations in mm, beside the centroid's shift.
    assert hinge["FM_p"] >= hinge["FM_x"] - 1e-9


def test_place_errors_are_distances_of_points():
    fit = fit_joint(
        [ball(q) for q in np.radians([[20, 10, 5], [60, -10, -5], [40, 5, 20]])], 3, HINTS, near=CENTRE
    )
    points = np.array([[30.0, 0, 0], [50.0, 4, 2]])
    shift = RigidTransform(np.eye(3), np.array([0, 0.3, 0.4]))
    errors = fit.place_errors([shift @ ball(np.radians([30, 0, 0]))], points)
    assert errors == pytest.approx([0.5], abs=1e-6)


def test_a_ball_without_variety_does_not_tell_its_centre():
    """All turns about one axis: the centre along it is free, and the deviation says so."""
    about = unit([0.2, 1, 0.1])
    alike = [RigidTransform.about(CENTRE, turn(a * about)) for a in (0.4, 0.8, 1.2)]
    known = JointKnowledge.assess(fit_joint(alike, 3, HINTS, near=CENTRE), alike)
    assert not known.centre_told and known.centre == pytest.approx(5, rel=0.01) and known.axes_told.all()
    rng = np.random.default_rng(0)
    varied = [noisy(ball(q), rng, 0.2, 0.05, at=CENTRE) for q in rng.uniform(-0.8, 0.8, (5, 3))]
    assert JointKnowledge.assess(fit_joint(varied, 3, HINTS, near=CENTRE), varied).centre_told


def test_one_pose_tells_a_hinge_that_turns_far_and_not_one_that_hardly_does():
    for angle, told in ((1.2, True), (0.02, False)):
        pose = [motion([unit([0, 1, 0.1])], CENTRE, [angle])]
        known = JointKnowledge.assess(fit_joint(pose, 1, HINTS[:1], near=CENTRE), pose)
        assert known.axes_told.tolist() == [told] and known.centre_told == told


@pytest.mark.parametrize(
    ("value", "kind"), [(0.49993, "marked"), (0.52, "doubtful"), (0.9, "sure"), (0.1, "marked")]
)
def test_a_confidence_near_the_limit_is_said_to_be_near(value, kind):
    verdict = LocationConfidence(0.9, 1.0, 0.0, value)
    assert verdict.value == pytest.approx(value)
    assert verdict.verdict.startswith(kind) and verdict.near == (abs(value - SURE) < 0.15)
    assert ("near the limit" in verdict.verdict) == verdict.near


def test_a_gap_of_neutral_is_no_departure():
    assert Departure(0, 0, 28.8, 0, 28.8).plausible == 1.0
    assert Departure(0, 0, 28.8, 0, 0.8).plausible == 0.0
