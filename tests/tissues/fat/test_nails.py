"""Rigid corrections of nails."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.mesh.shapes import sphere

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.fat.nails import as_vector, fit_correction, from_vector, nail_vertices


def _skin():
    """An ellipsoid of a finger tip's size: its patches are curved differently in every direction."""
    ball = sphere(1.0, 5)
    return ball.moved(ball.vertices * [14.0, 8.0, 6.0])


def _patch(skin):
    """Points of the upper side away from the middle, where curvature varies."""
    v = skin.vertices
    return v[(v[:, 2] > 3.0) & (v[:, 0] > 2.0)]


BONE = RigidTransform(Rotation.from_rotvec([0.3, 0.9, -0.4]).as_matrix(), np.array([5.0, -12.0, 30.0]))


def test_a_known_motion_is_recovered():
    skin = _skin()
    points = _patch(skin)
    centre = points.mean(axis=0)
    true = from_vector(np.array([0.05, -0.08, 0.03, 0.3, -0.2, 0.4]), centre)
    scan = skin.moved((BONE @ true)(skin.vertices))
    found = fit_correction(points, BONE, scan)
    error = np.linalg.norm(found(points) - true(points), axis=1)
    assert np.linalg.norm(true(points) - points, axis=1).mean() > 0.4
    assert error.max() < 0.1


def test_nothing_to_correct_gives_nothing():
    skin = _skin()
    found = fit_correction(_patch(skin), BONE, skin.moved(BONE(skin.vertices)))
    assert np.abs(as_vector(found, np.zeros(3))).max() < 1e-6


def test_a_flat_patch_does_not_wander():
    # A plane says nothing of slides along it: the correction must take the lift and leave the slide.
    grid = np.stack(np.meshgrid(np.arange(-20.0, 21.0), np.arange(-20.0, 21.0), indexing="ij"), axis=-1)
    flat = np.column_stack([grid.reshape(-1, 2), np.zeros(41 * 41)])
    index = np.arange(41 * 41).reshape(41, 41)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    points = flat[np.abs(flat[:, :2]).max(axis=1) < 5]
    scan = Surface(flat + [0.0, 0.0, 0.5], triangles)
    found = fit_correction(points, RigidTransform.identity(), scan)
    np.testing.assert_allclose(found(points) - points, np.tile([0, 0, 0.5], (len(points), 1)), atol=5e-3)


@pytest.mark.parametrize("seed", range(3))
def test_vectors_and_transforms_are_one_another(seed):
    rng = np.random.default_rng(seed)
    centre, vector = rng.normal(size=3) * 20, rng.uniform(-1, 1, size=6)
    np.testing.assert_allclose(as_vector(from_vector(vector, centre), centre), vector, atol=1e-12)
    points = rng.normal(size=(10, 3))
    moved = from_vector(vector, centre)(points)
    by_hand = Rotation.from_rotvec(vector[:3]).apply(points - centre) + centre + vector[3:]
    np.testing.assert_allclose(moved, by_hand, atol=1e-12)


def test_nail_vertices_lie_on_the_patch():
    skin = _skin()
    up = skin.vertices[:, 2] > 4.0
    inside = up[skin.triangles].all(axis=1)
    patch = Surface(skin.vertices, skin.triangles[inside]).compact()
    found = nail_vertices(skin, patch, 1e-6)
    np.testing.assert_array_equal(found, np.unique(skin.triangles[inside]))
