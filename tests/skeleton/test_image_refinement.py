"""A round bone whose roll its surface does not tell: texture within it and marks on it do."""

from __future__ import annotations

import logging
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.imaging.bone_surfaces import outline_surface
from handpipe.imaging.segmentation import BoneProbability
from handpipe.imaging.volumes import Volume
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration import PoseImages

SPACING, RADIUS, ENDS = 0.8, 5.0, (-8.0, 8.0)
LOW, HIGH = np.array([-18.0, -12.0, -12.0]), np.array([18.0, 12.0, 12.0])
STATED = 4.0  # deg, of a roll that the surface hardly tells
MOTION = RigidTransform(Rotation.from_rotvec([0.3, -0.5, 0.4]).as_matrix(), np.array([3.0, -2.0, 5.0]))
WAVES = np.random.default_rng(3).normal(size=(12, 3)) * 0.7
PHASES = np.random.default_rng(4).uniform(0, 6, 12)


def distance(points):
    """Negative in the bone: a capsule along x."""
    along = np.clip(points[..., 0], *ENDS)
    return np.hypot(np.hypot(points[..., 1], points[..., 2]), points[..., 0] - along) - RADIUS


def image(motion=None, dark=0.4, bright=1.0, seed=0, slid=0.0):
    """The bone, moved, with texture in it and a tendon on it that has slid around it by an angle in deg.

    dark, bright: levels of marrow and of muscle.
    """
    motion = RigidTransform.identity() if motion is None else motion
    corners = motion(np.array(list(product(*zip(LOW, HIGH, strict=True)))))
    affine = np.diag([SPACING] * 3 + [1.0])
    affine[:3, 3] = corners.min(axis=0)
    shape = np.ceil(np.ptp(corners, axis=0) / SPACING).astype(int)
    grid = Volume(np.zeros(shape, np.float32), affine)
    points = motion.inverse()(grid.to_world(np.indices(shape).reshape(3, -1).T))
    away = distance(points)
    texture = np.cos(points @ WAVES.T + PHASES).mean(axis=1)
    value = bright + (dark - bright) * (0.5 - 0.5 * np.tanh(away / 0.5)) * (1 + 0.6 * texture)
    place = 6.5 * np.array([np.cos(np.radians(slid)), np.sin(np.radians(slid))])
    tendon = np.hypot(*(points[:, 1:] - place).T) - 1.3
    value = np.where(away > 0, value * (0.55 + 0.45 * np.tanh(tendon / 0.5)), value)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(value))
    return grid.like((value + noise).reshape(shape))


@pytest.fixture(scope="module")
def bone():
    """The neutral image and the bone's surface."""
    volume = image()
    points = volume.to_world(np.indices(volume.shape).reshape(3, -1).T)
    inside = (0.5 - 0.5 * np.tanh(distance(points) / 0.8)).reshape(volume.shape)
    return volume, outline_surface(volume, BoneProbability(np.zeros(3, int), inside.astype(np.float32)))


def by_surfaces(turn=STATED, shift=0.2):
    """A registration that is off by a roll and a shift, and says so."""
    roll = Rotation.from_rotvec([np.radians(turn), 0, 0]).as_matrix()
    off = RigidTransform(roll, np.array([0, shift, 0]))
    deviations = np.array([np.radians(STATED), *[np.radians(0.5)] * 2, *[0.2] * 3])
    return Registration(MOTION @ off, 0.1, np.diag(deviations**2))


def stating(turn):
    """Covariance of a turn in deg about the long axis, and of a place in 0.1 mm."""
    return np.diag(np.array([np.radians(turn), *[1e-3] * 2, *[0.1] * 3]) ** 2)


def errors(registration):
    """Of the turn in deg and of the bone's middle in mm."""
    turn = np.degrees(registration.transform.angle_to(MOTION))
    return float(turn), float(np.linalg.norm(registration.transform.translation - MOTION.translation))


def refined(bone, target, found):
    return PoseImages(bone[0], target, {"bone": bone[1]}).refined("bone", found)


def test_images_of_one_contrast_tell_the_roll_and_how_well(bone) -> None:
    start = by_surfaces()
    assert errors(start)[0] == pytest.approx(STATED)
    found = refined(bone, image(MOTION, seed=1), start)
    turn, _ = errors(found)
    assert turn < 0.3
    assert turn < 2 * found.rotation_deviation < STATED


def test_images_leave_the_place(bone) -> None:
    """Fat is shifted in images, and fields distort them: surfaces tell the place, and how well."""
    start = by_surfaces()
    found = refined(bone, image(MOTION, seed=1), start)
    middle = bone[1].vertices.mean(axis=0)
    np.testing.assert_allclose(found.transform(middle), start.transform(middle), atol=1e-9)
    np.testing.assert_array_equal(found.covariance[3:, 3:], start.covariance[3:, 3:])


def test_known_turn_is_kept(bone) -> None:
    """Images would turn a bone that is off by 0.4 deg; where surfaces state half a degree, none may."""
    known, open_one = (Registration(by_surfaces(turn=0.4).transform, 0.1, stating(d)) for d in (0.4, 2.0))
    target = image(MOTION, seed=1)
    assert refined(bone, target, known) is known
    assert errors(refined(bone, target, open_one))[0] < errors(open_one)[0] - 0.1


def test_noisy_image_that_knows_the_turn_no_better_changes_nothing(bone, caplog) -> None:
    caplog.set_level(logging.INFO)
    target = image(MOTION)
    noise = 0.5 * np.random.default_rng(3).standard_normal(target.shape)
    start = Registration(by_surfaces(turn=0.4).transform, 0.1, stating(0.6))
    assert refined(bone, target.like(target.values + noise), start) is start
    assert "much better" in caplog.text


def test_contrast_that_turns_over_tells_the_roll_but_the_deviation_stays(bone) -> None:
    start = by_surfaces()
    found = refined(bone, image(MOTION, dark=1.0, bright=0.5, seed=1), start)
    assert errors(found)[0] < 1.0
    assert found.rotation_deviation > 0.999 * start.rotation_deviation


def test_tissue_that_slides_on_the_bone_is_part_of_the_deviation(bone) -> None:
    """The tendon takes the roll with it: the bone's own texture is weaker."""
    found = refined(bone, image(MOTION, seed=1, slid=4.0), by_surfaces())
    turn, _ = errors(found)
    assert turn == pytest.approx(4.0, abs=1.0)
    assert turn < 2 * found.rotation_deviation


def test_unrelated_image_changes_nothing(bone, caplog) -> None:
    target = image(MOTION)
    noise = target.like(np.random.default_rng(5).random(target.shape))
    start = by_surfaces()
    assert refined(bone, noise, start) is start
    assert "little in common" in caplog.text


def test_place_far_from_the_surfaces_is_not_taken_but_stated(bone, caplog) -> None:
    """The image shows the bone rolled far beyond what the surfaces allow."""
    sure = np.diag(np.array([*[np.radians(0.3)] * 3, *[0.05] * 3]) ** 2)
    start = Registration(by_surfaces(turn=5.0).transform, 0.1, sure)
    found = refined(bone, image(MOTION, seed=1), start)
    assert found.transform is start.transform
    assert found.rotation_deviation == pytest.approx(5.0, abs=0.5)
    assert "which is kept" in caplog.text


def half_turned(found):
    """The same turned by half a turn about the bone's long axis."""
    half = RigidTransform(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    return Registration(found.transform @ half, found.rms, found.covariance)


def chosen(bone, target, places):
    return PoseImages(bone[0], target, {"bone": bone[1]}).chosen("bone", places)


@pytest.mark.parametrize("slid", [0.0, 20.0])
def test_images_choose_the_place_that_they_show(bone, slid) -> None:
    target, right = image(MOTION, seed=1, slid=slid), by_surfaces()
    assert chosen(bone, target, [right, half_turned(right)]) == 0
    assert chosen(bone, target, [half_turned(right), right]) == 1
    assert chosen(bone, target, [half_turned(right), right, by_surfaces(turn=-STATED)]) in (1, 2)


def test_an_image_that_shows_neither_place_chooses_none(bone) -> None:
    target, right = image(MOTION), by_surfaces()
    noise = np.random.default_rng(3).standard_normal(target.shape)
    assert chosen(bone, target.like(target.values + 2.0 * noise), [right, half_turned(right)]) is None
    assert chosen(bone, target.like(noise), [right, half_turned(right)]) is None


def test_two_wrong_places_are_not_chosen_from(bone) -> None:
    """Quarter turns show as little of neutral's texture as one another."""
    quarter = [by_surfaces(turn=90.0), by_surfaces(turn=-90.0)]
    assert chosen(bone, image(MOTION, seed=1), quarter) is None
