"""Distances to bodies from frame to frame: those of a new tree, whatever was kept."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.mesh.contact import distance_to
from handpipe.mesh.surfaces import BodyDistances, Distance, Surface, barycentric_weights, concatenate
from handpipe.mesh.surfaces.moving import RigidDistance, rigid_motion

from .shapes import box, sphere

BODY = sphere(5.0, 3).moved(sphere(5.0, 3).vertices * [1.0, 2.0, 0.5])
POINTS = np.random.default_rng(0).normal(size=(500, 3)) * 8


def _turned(seed, surface=BODY):
    random = np.random.default_rng(seed)
    motion = RigidTransform(Rotation.random(rng=random).as_matrix(), random.normal(size=3) * 30)
    return motion, surface.moved(motion(surface.vertices))


def _agree(found, expected, points):
    """Equal distances, places and normals; of triangles that share a place, each may name another one."""
    for kind in ("signed", "smooth"):
        distances, triangles, closest, normals = getattr(found, kind)(points)
        wanted = getattr(expected, kind)(points)
        np.testing.assert_allclose(distances, wanted[0], atol=1e-9)
        np.testing.assert_allclose(closest, wanted[2], atol=1e-9)
        np.testing.assert_allclose(normals, wanted[3], atol=1e-6)
        corners = expected.surface.vertices[expected.surface.triangles[triangles]]
        weights = barycentric_weights(closest, corners)
        assert weights.min() > -1e-6
        np.testing.assert_allclose(np.einsum("nc,nci->ni", weights, corners), closest, atol=1e-9)
    np.testing.assert_allclose(found.closest(points)[0], expected.closest(points)[0], atol=1e-9)
    np.testing.assert_allclose(found.depths(points), expected.depths(points), atol=1e-9)
    ways = np.roll(points, 1, axis=0) / np.linalg.norm(np.roll(points, 1, axis=0), axis=1, keepdims=True)
    for ours, theirs in zip(
        found.ways_out(points, ways, 9.0), expected.ways_out(points, ways, 9.0), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-8)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_rigid_body_has_the_distances_of_a_new_tree(seed):
    bodies = BodyDistances()
    for number in (seed, seed + 10):  # the second time the tree is known
        motion, surface = _turned(number)
        found = bodies.to("body", BODY.vertices, surface)
        assert isinstance(found, RigidDistance)
        _agree(found, Distance(surface), motion(POINTS))


def test_a_body_that_deforms_has_its_own_tree_in_each_frame():
    bodies = BodyDistances()
    for stretch in (1.2, 0.8):
        surface = BODY.moved(BODY.vertices * [stretch, 1.0, 1.0])
        found = bodies.to("body", BODY.vertices, surface)
        assert not isinstance(found, RigidDistance)
        np.testing.assert_array_equal(found.signed(POINTS)[0], Distance(surface).signed(POINTS)[0])
        assert bodies.to("body", BODY.vertices, Surface(surface.vertices, surface.triangles)) is found


def test_another_body_of_the_same_name_is_not_taken_for_the_first():
    bodies, other = BodyDistances(), box((4.0, 3.0, 2.0))
    bodies.to("body", BODY.vertices, BODY)
    found = bodies.to("body", other.vertices, other)
    _agree(found, Distance(other), POINTS)


def test_a_rigid_body_that_cuts_itself_keeps_the_sign_of_windings():
    both = concatenate([BODY, BODY.moved(BODY.vertices + [2.0, 0, 0])])
    motion, surface = _turned(4, both)
    found = BodyDistances(distance_to).to("both", both.vertices, surface)
    assert found.by_winding
    _agree(found, Distance(surface, by_winding=True), motion(POINTS))


def test_neither_a_mirrored_nor_a_bent_body_has_moved_rigidly():
    uneven = np.random.default_rng(5).normal(size=(20, 3))
    assert rigid_motion(uneven, uneven * [-1.0, 1.0, 1.0]) is None
    assert rigid_motion(uneven, uneven + 1e-6 * uneven**2) is None
