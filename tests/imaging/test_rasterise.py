import numpy as np
import pytest
import trimesh

from handpipe.imaging.volumes.band import DistanceBand
from handpipe.imaging.volumes.rasterisation import inside, rasterise
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

SKEWED = np.array([[0.3, -0.4, 0.0, -5.0], [0.4, 0.3, 0.0, -6.0], [0.0, 0.0, 1.0, -4.0], [0, 0, 0, 1.0]])


def surface(mesh):
    return Surface(np.array(mesh.vertices), np.array(mesh.faces, np.int64))


def knotted():
    """A torus, tilted: columns of voxels enter and leave it twice."""
    mesh = trimesh.creation.torus(3.0, 1.1, major_sections=40, minor_sections=20)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 0.3]))
    return surface(mesh)


def empty(affine, shape=(24, 26, 9)):
    return Volume(np.zeros(shape, np.float32), affine)


def centres(volume):
    return volume.to_world(np.indices(volume.shape).reshape(3, -1).T)


def test_voxels_inside_are_those_of_negative_distance() -> None:
    """On a turned grid of voxels that are no cubes, against signed distances."""
    volume, torus = empty(SKEWED), knotted()
    expected = Distance(torus).signed(centres(volume))[0].reshape(volume.shape) < 0
    assert expected.sum() > 100
    np.testing.assert_array_equal(inside(volume, torus), expected)


@pytest.mark.parametrize("spacing", [1.0, 0.5])
def test_vertices_and_edges_on_voxel_centres(spacing) -> None:
    """Columns that run along faces, edges and through vertices count each half-open box once."""
    box = surface(trimesh.creation.box(bounds=[[2.0, 3.0, 1.0], [7.0, 6.0, 4.0]]))
    volume = empty(np.diag([spacing] * 3 + [1.0]), (24, 26, 24))
    points = centres(volume)
    low, high = np.array([2.0, 3.0, 1.0]), np.array([7.0, 6.0, 4.0])
    expected = ((points >= low) & (points < high)).all(axis=1).reshape(volume.shape)
    np.testing.assert_array_equal(inside(volume, box), expected)


def test_a_fan_around_a_column_covers_it_once() -> None:
    """A closed surface whose vertex of many triangles lies on a voxel's column."""
    cone = trimesh.creation.cone(radius=3.0, height=5.0, sections=17)
    cone.apply_translation([5.0, 5.0, 1.25])
    volume = empty(np.eye(4), (11, 11, 9))
    np.testing.assert_array_equal(
        inside(volume, surface(cone))[5, 5], (np.arange(9) >= 2) & (np.arange(9) <= 6)
    )


def test_labels_beyond_the_volume_are_clipped() -> None:
    volume = empty(np.eye(4), (6, 6, 6))
    ball = surface(trimesh.creation.icosphere(3, radius=3.0))
    labels = rasterise(volume, {4: ball, 9: Surface(ball.vertices + 100.0, ball.triangles)})
    expected = np.linalg.norm(centres(volume), axis=1).reshape(volume.shape) < 2.95
    assert set(np.unique(labels)) == {0, 4}
    np.testing.assert_array_equal(labels[expected], 4)


def test_band_is_the_signed_distance_up_to_its_reach() -> None:
    volume, torus = empty(SKEWED), knotted()
    reach = 1.2
    band = DistanceBand.around(torus, volume, reach)
    exact = Distance(torus).signed(centres(volume))[0].reshape(volume.shape)
    near = np.abs(exact) < reach - 0.3  # the band is around vertices, not triangles
    np.testing.assert_allclose(band.signed[near], exact[near], atol=1e-9)
    np.testing.assert_array_equal(np.sign(band.signed), np.sign(exact))
    assert np.abs(band.signed).max() == reach
    on_surface = Distance(torus).closest(band.closest)[0]
    assert np.abs(on_surface).max() < 1e-9
