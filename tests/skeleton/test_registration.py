import numpy as np
import pytest
from manufactured import bone, turn, unit

from handpipe.errors import ConvergenceError
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.skeleton.registration import principal_starts, register

NEUTRAL = bone(60, 48)
TRUTH = RigidTransform(turn(np.radians(100) * unit([0.3, 0.9, -0.2])), np.array([31.0, -12.0, 55.0]))


def rotation_error(found, truth):
    return np.degrees(found.transform.angle_to(truth))


def centre_error(found, truth):
    middle = NEUTRAL.vertices.mean(axis=0)
    return np.linalg.norm(found.transform(middle) - truth(middle))


@pytest.mark.parametrize("roll", [0.0, 90.0, 180.0, 270.0])
def test_large_rotations_between_different_meshes(roll):
    target = bone(43, 61, stretch=1.4, seed=1)
    truth = TRUTH @ RigidTransform(turn(np.radians([roll, 0, 0])), np.zeros(3))
    found = register(NEUTRAL, target.moved(truth(target.vertices)))
    assert rotation_error(found, truth) < 0.1
    assert centre_error(found, truth) < 0.02


def test_noise_and_its_covariance():
    target = bone(40, 44, stretch=1.2)
    errors, deviations = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        points = TRUTH(target.vertices) + 0.15 * rng.normal(size=target.vertices.shape)
        found = register(NEUTRAL, target.moved(points), start=TRUTH)
        back = RigidTransform(found.transform.rotation, np.zeros(3)).inverse()
        turned = RigidTransform(TRUTH.rotation @ back.rotation, np.zeros(3)).rotation_vector()
        middle = NEUTRAL.vertices.mean(axis=0)
        errors.append(np.concatenate([turned, TRUTH(middle) - found.transform(middle)]))
        deviations.append(np.linalg.cholesky(found.covariance))
    # Whitened by the estimated covariance, errors are of unit size: 36 numbers, within a factor 1.5.
    white = np.array([np.linalg.solve(c, e) for c, e in zip(deviations, errors, strict=True)])
    assert 0.65 < np.sqrt((white**2).mean()) < 1.5
    long_axis = TRUTH.rotation[:, 0]
    rolls = [np.sqrt(long_axis @ (c @ c.T)[:3, :3] @ long_axis) for c in deviations]
    tilts = [np.sqrt(np.linalg.eigvalsh((c @ c.T)[:3, :3])[0]) for c in deviations]
    assert np.mean(rolls) > 2 * np.mean(tilts)  # the rotation about the long axis is the uncertain one


def test_a_target_that_lacks_its_base():
    target = bone(70, 50, stretch=1.3)
    centres = target.vertices[target.triangles].mean(axis=1)
    part = Surface(target.vertices, target.triangles[centres[:, 0] > -9]).compact()
    found = register(NEUTRAL, part.moved(TRUTH(part.vertices)))
    assert rotation_error(found, TRUTH) < 0.15
    assert centre_error(found, TRUTH) < 0.05


def test_a_leak_of_the_segmentation_is_ignored():
    target = bone(60, 50, stretch=1.3, seed=2)
    vertices = target.vertices.copy()
    leak = np.linalg.norm(vertices - vertices[np.argmax(vertices[:, 2])], axis=1) < 3
    vertices[leak] += [0, 0, 2.5]
    found = register(NEUTRAL, target.moved(TRUTH(vertices)))
    assert rotation_error(found, TRUTH) < 0.2
    assert centre_error(found, TRUTH) < 0.05


def test_starts_hold_a_good_guess():
    target = bone(30, 30)
    truth = TRUTH
    starts = principal_starts(NEUTRAL, target.moved(truth(target.vertices)))
    assert min(np.degrees(s.angle_to(truth)) for s in starts) < 25


def test_another_shape_is_refused():
    other = bone(8, 10)
    ball = 30 * other.vertices / np.linalg.norm(other.vertices, axis=1)[:, None]
    with pytest.raises(ConvergenceError):
        register(NEUTRAL, other.moved(ball))
