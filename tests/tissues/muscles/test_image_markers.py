"""Where a muscle's boundary is not taken from: bones below it, gaps beside a muscle that touches it."""

import numpy as np
import pytest
from tests.fem.bodies import sphere

from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.muscles.fitting.extraction import NEAR, TOUCHING, WITHIN, image_markers
from handpipe.tissues.muscles.fitting.soft_body import SoftBody

VOXEL, SIZE = 0.5, 24.0  # mm
MUSCLE, FAT, MARROW, CORTEX = 0.45, 1.0, 0.9, 0.05
BONE, THICK = np.array([0.0, 0.0, -17.0]), 0.8


def ball(radius, centre=(0, 0, 0)) -> Surface:
    points, triangles = sphere(radius, 4)
    return Surface(points + np.asarray(centre), triangles)


@pytest.fixture(scope="module")
def image() -> Volume:
    """A muscle of 8 mm on a bone of 10 mm, dark but for its marrow, and against another muscle."""
    axis = np.arange(-SIZE, SIZE, VOXEL)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    from_bone = np.linalg.norm(points - BONE, axis=-1)
    muscle = (np.linalg.norm(points, axis=-1) < 8) | (np.linalg.norm(points - [15, 0, 0], axis=-1) < 7.5)
    value = np.where(muscle, MUSCLE, FAT)
    value = np.where(from_bone < 10, CORTEX, value)
    value = np.where(from_bone < 10 - THICK, MARROW, value)
    affine = np.diag([VOXEL, VOXEL, VOXEL, 1.0])
    affine[:3, 3] = -SIZE
    return Volume(value.astype(np.float32), affine)


def body() -> SoftBody:
    surface = ball(8.2)
    top = np.flatnonzero(surface.vertices[:, 2] > 7.5)
    return SoftBody.fill(surface, {"bone": top}, 2.0)


def test_the_edge_of_marrow_below_a_muscle_is_not_its_boundary(image):
    depth = Distance(ball(10.0, BONE))
    blind = image_markers(image, body())(body().surface)
    seeing = image_markers(image, body(), bones=depth)(body().surface)
    assert (depth.signed(blind.points)[0] < -WITHIN).sum() > 5
    assert depth.signed(seeing.points)[0].min() > -WITHIN
    assert np.isin(blind.vertices[depth.signed(blind.points)[0] > 0], seeing.vertices).all()


def test_a_place_on_a_neighbour_has_no_marker_far_from_it(image):
    """A guess that reaches 1 mm too far, into its neighbour, and would find the gap beside both."""
    neighbour = ball(7.5, (15, 0, 0))
    wide = ball(9.0, (0.5, 0, 0))
    guess = SoftBody.fill(wide, {"bone": np.flatnonzero(wide.vertices[:, 2] > 8.5)}, 2.0)
    found = image_markers(image, guess, None, [neighbour])(wide)
    places = wide.vertices[found.vertices]
    on_it = Distance(neighbour).signed(places)[0] < TOUCHING
    assert np.linalg.norm(found.points - places, axis=1)[on_it].max(initial=0.0) < NEAR
    assert (~on_it).sum() > 500
