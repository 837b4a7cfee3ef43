"""Images carried along with a known motion: a bar bent into an arc, a rigid core, gaps between parts."""

import numpy as np
import pytest
from scipy import ndimage
from tests.mesh.shapes import box, box_tets

from handpipe.core.rigid import RigidTransform
from handpipe.imaging.volumes.volume import Volume
from handpipe.imaging.warping.backward_field import BackwardField, Source
from handpipe.imaging.warping.places import Places
from handpipe.imaging.warping.similarity import correlation, local_correlation
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh

SIZE = np.array([40.0, 10.0, 10.0])
RADIUS = 30.0  # of the arc into which the bar's axis is bent, mm


def bent(points: np.ndarray) -> np.ndarray:
    """Planes across the bar turn about y: a closed form, inverted by `straightened`."""
    angle, out = points[:, 0] / RADIUS, RADIUS + points[:, 2]
    return np.stack([out * np.sin(angle), points[:, 1], out * np.cos(angle) - RADIUS], axis=1)


def straightened(points: np.ndarray) -> np.ndarray:
    up = points[:, 2] + RADIUS
    return np.stack(
        [RADIUS * np.arctan2(points[:, 0], up), points[:, 1], np.hypot(points[:, 0], up) - RADIUS], axis=1
    )


def texture(points: np.ndarray) -> np.ndarray:
    x, y, z = points.T
    return 100 + 30 * np.sin(x / 4) + 20 * np.cos(y / 3 + x / 9) + 20 * np.sin(z / 3)


def bar(cells: int) -> TetMesh:
    mesh = box_tets(cells)
    return TetMesh((mesh.vertices - [0, 0.5, 0.5]) * SIZE, mesh.tets)


def grid(spacing: float) -> Volume:
    """Around the bar at rest and bent, turned against the axes."""
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]])
    affine = np.eye(4)
    affine[:3, :3] = turn * spacing
    affine[:3, 3] = [-8, -30, -40]
    shape = tuple((np.array([60, 62, 50]) / spacing).astype(int))
    return Volume(np.zeros(shape, np.float32), affine)


def centres(volume: Volume) -> np.ndarray:
    return volume.to_world(np.indices(volume.shape).reshape(3, -1).T)


def neutral(spacing: float = 0.5) -> Volume:
    affine = np.diag([spacing, spacing, spacing, 1.0])
    affine[:3, 3] = [-2, -7, -7]
    empty = Volume(np.zeros(tuple((np.array([44, 14, 14]) / spacing).astype(int)), np.float32), affine)
    return empty.like(texture(centres(empty)).reshape(empty.shape))


def within(volume: Volume, margin: float = 0.0) -> np.ndarray:
    """Voxels of the bent bar by its closed form."""
    rest = straightened(centres(volume)) + [0, 5, 5]
    return ((rest > margin) & (rest < SIZE - margin)).all(axis=1).reshape(volume.shape)


def bend(cells: int, spacing: float = 1.0) -> tuple[Volume, Places, int]:
    space, mesh = grid(spacing), bar(cells)
    field = BackwardField(space, within(space, 0.5))
    left_out = field.add_tets(bent(mesh.vertices), mesh.vertices, mesh.tets)
    return space, field.filled(), left_out


def test_image_of_a_bent_bar_is_its_texture_at_the_closed_form() -> None:
    """The error falls with the square of the tets' size: linear interpolation of a smooth map."""
    errors = []
    for cells in (4, 8):
        space, places, left_out = bend(cells)
        assert left_out == 0 and len(places.rest) == within(space, 0.5).sum() > 3000
        expected = straightened(space.to_world(places.voxels))
        used = places.source == Source.tets
        assert used.mean() > 0.95
        errors.append(np.sqrt(((places.rest - expected)[used] ** 2).sum(axis=1).mean()))
        shown = places.values(neutral())
        assert np.abs(shown - texture(expected))[used].max() < (14 if cells == 4 else 5)
    assert errors[0] / errors[1] > 3.2 and errors[1] < 0.1


def test_moved_image_is_zero_outside_of_the_body_and_its_value_inside() -> None:
    space, places, _ = bend(4)
    image = places.on_grid(places.values(neutral()))
    assert image.shape == space.shape
    np.testing.assert_array_equal(image.values > 0, within(space, 0.5))
    np.testing.assert_array_equal(places.at(image), places.values(neutral()).astype(np.float32))


def test_a_rigid_part_takes_precedence_and_is_exact() -> None:
    """A core moved otherwise than the tets around it."""
    space, mesh = grid(1.0), bar(4)
    turn = RigidTransform.about(np.array([20.0, 0, 0]), np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]))
    start = np.array([12.013, -3.017, -3.019])  # no centre of a voxel lies on a face
    core = box((10.0, 6.0, 6.0))
    moved = Surface(turn(core.vertices + start), core.triangles)
    moved = moved if moved.volume() > 0 else moved.flipped()
    field = BackwardField(space, np.ones(space.shape, bool))
    field.add_rigid(moved, turn.inverse())
    field.add_tets(mesh.vertices, mesh.vertices, mesh.tets)
    places = field.filled()
    rigid = places.source == Source.rigid
    expected = turn.inverse()(space.to_world(places.voxels))
    inside = ((expected > start) & (expected < start + [10, 6, 6])).all(axis=1)
    np.testing.assert_array_equal(rigid, inside)
    np.testing.assert_allclose(places.rest[rigid], expected[rigid], atol=1e-12)
    elastic = places.source == Source.tets
    np.testing.assert_allclose(places.rest[elastic], space.to_world(places.voxels)[elastic], atol=1e-9)


def test_a_gap_between_two_parts_is_filled_by_a_harmonic_displacement() -> None:
    """Between two halves drawn apart along x the displacement is linear in x."""
    affine = np.diag([0.5, 1.0, 1.0, 1.0])  # voxels that are no cubes
    affine[:3, 3] = [0.25, -4.5, -4.5]
    space = Volume(np.zeros((100, 10, 10), np.float32), affine)
    field = BackwardField(space, np.ones(space.shape, bool))
    half = box((20.0, 10.0, 10.0))
    for start, shift in ((0.0, 0.0), (30.0, 10.0)):
        moved = Surface(half.vertices + [start, -5, -5], half.triangles)
        moved = moved if moved.volume() > 0 else moved.flipped()
        field.add_rigid(moved, RigidTransform(np.eye(3), np.array([-shift, 0, 0])))
    places = field.filled()
    gap = places.source == Source.gap
    assert gap.sum() * 0.5 == pytest.approx(10 * 10 * 10)
    x = space.to_world(places.voxels)[:, 0]
    share = np.clip((x - 19.75) / 10.5, 0, 1)  # from the last known centre to the next known one
    np.testing.assert_allclose((places.rest - space.to_world(places.voxels))[:, 0], -10 * share, atol=1e-4)


def test_voxels_beside_nothing_known_take_the_nearest_displacement() -> None:
    space = Volume(np.zeros((12, 4, 4), np.float32), np.eye(4))
    body = np.ones(space.shape, bool)
    body[6] = False  # cuts the body in two: one half has no known voxel
    field = BackwardField(space, body)
    field.add_points(np.array([[2.0, 1, 1]]), np.array([[2.0, 1, 4]]))
    places = field.filled()
    np.testing.assert_allclose(places.rest - places.voxels, np.tile([0, 0, 3.0], (len(places.rest), 1)))


def test_points_in_one_voxel_are_averaged_and_come_after_what_is_known() -> None:
    space = Volume(np.zeros((6, 6, 6), np.float32), np.eye(4))
    field = BackwardField(space, np.ones(space.shape, bool))
    field.add_points(
        np.array([[2.2, 2, 2], [1.8, 2, 2], [9.0, 9, 9]]), np.array([[3.2, 2, 2], [4.8, 2, 2], [0, 0, 0.0]])
    )
    field.add_points(np.array([[2.0, 2, 2], [4.0, 4, 4]]), np.array([[0.0, 0, 0], [4.0, 4, 5]]))
    places = field.filled()
    rest = {tuple(v): p for v, p, s in zip(places.voxels, places.rest, places.source, strict=True) if s}
    assert rest.keys() == {(2, 2, 2), (4, 4, 4)}
    np.testing.assert_allclose(rest[2, 2, 2], [4, 2, 2])
    np.testing.assert_allclose(rest[4, 4, 4], [4, 4, 5])


def test_reserved_voxels_are_filled_and_not_taken_from_tets() -> None:
    space, mesh = grid(1.0), bar(4)
    core = box((10.0, 6.0, 6.0))
    core = Surface(core.vertices + [12.0, -3, -3], core.triangles)
    core = core if core.volume() > 0 else core.flipped()
    field = BackwardField(space, np.ones(space.shape, bool))
    field.reserve(core)
    field.add_tets(mesh.vertices, mesh.vertices, mesh.tets)
    places = field.filled()
    where = space.to_world(places.voxels)
    inside = ((where > [12, -3, -3]) & (where < [22, 3, 3])).all(axis=1)
    assert (places.source[inside] == Source.gap).all()
    np.testing.assert_allclose(places.rest[inside], where[inside], atol=1e-6)


def test_inverted_tets_are_left_out_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    space, mesh = grid(1.0), bar(2)
    tets = mesh.tets.copy()
    tets[:5] = tets[:5, [1, 0, 2, 3]]
    field = BackwardField(space, np.ones(space.shape, bool))
    assert field.add_tets(mesh.vertices, mesh.vertices, tets) == 5
    assert "5 of 48 tets are inverted" in caplog.text


def test_places_beyond_the_neutral_image_are_dark_and_said() -> None:
    _, places, _ = bend(4)
    image = neutral()
    short = Volume(image.values[:40], image.affine)  # ends at x = 17.75
    seen = places.imaged(short)
    np.testing.assert_array_equal(seen, places.rest[:, 0] < 17.75)
    assert (places.values(short)[~seen] == 0).all() and places.imaged(image).all()


def test_correlation_is_that_of_numpy_and_ignores_gain_and_offset() -> None:
    a, b = np.random.default_rng(0).normal(size=(2, 500))
    assert correlation(a, b) == pytest.approx(np.corrcoef(a, b)[0, 1])
    assert correlation(a, 3 * a + 7) == pytest.approx(1)
    assert correlation(a, -a) == pytest.approx(-1)
    assert correlation(a, np.ones(500)) == 0 == correlation(a[:0], b[:0])


def test_local_correlation_sees_through_shading_and_sees_a_shift() -> None:
    pattern = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(30, 30, 30)), 2)
    image = 50 + 15 * pattern / pattern.std()
    shading = 1 + np.linspace(0, 2, 30)[:, None, None]
    body = np.zeros(image.shape, bool)
    body[4:26, 3:27, 5:25] = True
    width = np.full(3, 9.0)
    spoilt = np.where(body, image * shading, 1e6)  # what lies outside of the body does not count
    shaded = local_correlation(spoilt, image, body, width)
    whole = correlation((image * shading)[body], image[body])
    shifted = local_correlation(np.roll(image, 4, axis=0), image, body, width)
    assert whole < 0.8 < 0.88 < shaded and shifted < 0.6
    assert local_correlation(image, image, body, width) == pytest.approx(1)
    assert local_correlation(image, np.ones_like(image), body, width) == 0
