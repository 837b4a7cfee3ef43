"""Which places of neighbouring muscles touch."""

import numpy as np
import trimesh
from tests.mesh.shapes import folded_ball, sphere

from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface, concatenate
from handpipe.tissues.muscles.neighbours import pairs, sliding_vertices, touching


def box(size, centre, edge=1.0) -> Surface:
    mesh = trimesh.creation.box(size).subdivide_to_size(edge)
    return Surface(np.asarray(mesh.vertices) + centre, np.asarray(mesh.faces, dtype=np.int64))


SHEET = box((30.0, 30.0, 2.0), (0.0, 0.0, 0.0))


def test_a_vertex_is_pushed_back_to_the_side_that_it_came_from():
    """A ball above a sheet of 2 mm that has sunk into it, less and more than halfway."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
    for depth in (0.5, 1.7):
        above = Surface(
            np.asarray(ball.vertices) + [0, 0, 6.0 - depth], np.asarray(ball.faces, dtype=np.int64)
        )
        found = pairs(above, Distance(SHEET), 0.3)
        inside = found.gaps < 0
        assert inside.any()
        np.testing.assert_allclose(found.normals[inside], np.tile([0, 0, 1.0], (inside.sum(), 1)), atol=1e-9)
        heights = above.vertices[found.vertices[inside], 2]
        np.testing.assert_allclose(found.gaps[inside], heights - 1.0, atol=1e-9)


def test_no_pair_comes_or_goes_while_a_ball_sinks_through_the_middle_of_a_sheet():
    """Its deepest vertex is pushed back as far as it is deep, also where the sheet's far side is nearer."""
    ball = sphere(5.0, 4)
    lowest = int(ball.vertices[:, 2].argmin())
    for depth in np.arange(0.1, 1.9, 0.01):
        found = pairs(ball.moved(ball.vertices + [0, 0, 6.0 - depth]), Distance(SHEET), 0.3)
        [at] = np.flatnonzero(found.vertices == lowest)
        np.testing.assert_allclose(found.gaps[at], -depth, atol=1e-6)
        np.testing.assert_allclose(found.normals[at], [0, 0, 1.0], atol=1e-6)


def test_a_vertex_that_finds_no_way_back_is_left_free():
    """A ball that has sunk 11 mm into a block of 12 mm: its lowest vertices are nearer to the bottom."""
    block, ball = box((40.0, 40.0, 12.0), (0.0, 0.0, 0.0), 4.0), sphere(5.0, 3)
    found = pairs(ball, Distance(block), 0.3)
    assert not np.isin(np.flatnonzero(ball.vertices[:, 2] < -1.0), found.vertices).any()


def test_held_vertices_and_far_ones_are_left_out():
    block = box((4.0, 4.0, 4.0), (0.0, 0.0, 3.2))
    found = pairs(block, Distance(SHEET), 1.0)
    bottom = np.flatnonzero(block.vertices[:, 2] < 1.5)
    assert set(bottom) <= set(found.vertices)
    left = found.without(bottom[::2])
    assert set(left.vertices) == set(found.vertices) - set(bottom[::2])
    np.testing.assert_allclose(left.gaps, block.vertices[left.vertices, 2] - 1.0, atol=1e-9)
    feet = left.feet @ SHEET.vertices
    np.testing.assert_allclose(feet, block.vertices[left.vertices] * [1, 1, 0] + [0, 0, 1.0], atol=1e-9)


def test_normals_turn_without_a_jump_from_facet_to_facet():
    """Points every 0.1 degrees along an arc over a coarse ball, whose facets differ by 10 degrees."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=8.0)
    angles = np.radians(np.arange(0.0, 90.0, 0.1))
    directions = np.cos(angles)[:, None] * [0.6, 0.0, 0.8] + np.sin(angles)[:, None] * [0.0, 1.0, 0.0]
    count = np.arange(len(angles))
    arc = Surface(8.05 * directions, np.stack([count, np.roll(count, 1), np.roll(count, 2)], axis=1))
    coarse = Surface(np.asarray(ball.vertices), np.asarray(ball.faces, dtype=np.int64))
    found = pairs(arc, Distance(coarse), 0.5)
    assert np.array_equal(found.vertices, count)
    turns = np.degrees(np.linalg.norm(np.diff(found.normals, axis=0), axis=1))
    assert turns.max() < 0.3
    assert np.einsum("ni,ni->n", found.normals, directions).min() > np.cos(np.radians(2))


def test_what_lies_beyond_a_fold_of_a_muscle_does_not_touch_it():
    """By the side of the closest triangle it would be 3 mm inside: there the muscle is inside out."""
    far_end = sphere(1.0, 3)
    muscle = concatenate([folded_ball(), far_end.moved(far_end.vertices - [0.0, 0.0, 18.0])])
    beyond = far_end.moved(far_end.vertices - [0.0, 0.0, 12.0])
    assert Distance(muscle).signed(beyond.vertices)[0].min() < -3.0
    assert len(touching(beyond, [muscle], 1.0)) == 0
    assert sliding_vertices([{"muscle": muscle, "other": beyond}], 1.0) == {}
