"""Pictures and movies against what spheres and boxes must look like."""

import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image as images

from handpipe.core import InputError
from handpipe.evaluation.rendering import (
    TRANSFERS,
    Camera,
    ColourBar,
    Cut,
    Drawable,
    Transfer,
    render,
    render_volume,
    window,
    write_movie,
)
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces.surface import Surface

# looks down z: x is right, y is up
CAMERA = Camera(np.zeros(3), np.array([0.0, 0, -1]), np.array([0.0, 1, 0]), height=20.0)
SIZE = (120, 100)
PIXEL = 20.0 / 100  # mm
RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def sphere(radius: float, centre=(0.0, 0.0, 0.0)) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Surface(np.asarray(mesh.vertices) + centre, np.asarray(mesh.faces, dtype=np.int64))


def cover(image) -> np.ndarray:
    """The share of each pixel that pure red or green bodies cover: blue is white's alone."""
    return 1 - image[..., 2] / 255.0


def test_silhouette_has_the_area_of_the_disc():
    image = render([Drawable(sphere(7), RED)], CAMERA, SIZE)
    assert image.shape == (100, 120, 3) and image.dtype == np.uint8
    inner = cover(image) > 0.5  # the highlight is whitish: count pixels
    filled = np.hypot(*(np.argwhere(inner) + 0.5 - [50, 60]).T).max() * PIXEL
    assert filled == pytest.approx(7, abs=PIXEL)
    assert (image.min(axis=2) < 128).sum() * PIXEL**2 == pytest.approx(np.pi * 49, rel=1e-2)


def test_scattered_light_reddens_the_rim_of_the_shade_alone():
    white = (0.9, 0.9, 0.9)
    plain, skin = (
        render([Drawable(sphere(7), white, scattering=scattering)], CAMERA, SIZE).astype(float)
        for scattering in (False, True)
    )
    change = skin - plain
    centre = np.array([50, 60])
    towards = np.array([-0.9, -0.8]) / np.hypot(0.9, 0.8)  # the key light, in rows and columns
    radius = 7 / PIXEL
    lit = tuple(np.round(centre + 0.62 * radius * towards).astype(int))
    rim = tuple(np.round(centre - 0.62 * radius * towards).astype(int))
    assert np.abs(change[lit]).max() < 3
    assert change[rim][0] > 10 and change[rim][0] > 2 * change[rim][2]


def test_place_in_the_picture_follows_the_cameras_axes():
    image = render([Drawable(sphere(2, (5, 3, 0)), RED)], CAMERA, SIZE)
    pixels = np.indices(image.shape[:2]).reshape(2, -1)
    row, column = np.average(pixels, axis=1, weights=(image.min(axis=2) < 128).ravel())
    assert ((column + 0.5) - 60) * PIXEL == pytest.approx(5, abs=0.05)
    assert (50 - (row + 0.5)) * PIXEL == pytest.approx(3, abs=0.05)


def test_nearer_body_hides_the_farther_one():
    bodies = [Drawable(sphere(3, (0, 0, -5)), GREEN), Drawable(sphere(2, (0, 0, 5)), RED)]
    middle = render(bodies, CAMERA, SIZE)[50, 60].astype(int)
    assert middle[0] > middle[1] + 100


def test_an_inner_body_is_hidden_by_an_opaque_one_and_seen_in_its_cut():
    bodies = [Drawable(sphere(3), GREEN), Drawable(sphere(8), RED, cap=(0.0, 0.0, 1.0))]
    closed = render(bodies, CAMERA, SIZE).astype(int)
    opened = render(bodies, CAMERA, SIZE, Cut(np.zeros(3), np.array([0.0, 0, 1]))).astype(int)
    assert closed[50, 60, 0] > closed[50, 60, 1] + 100
    assert tuple(opened[50, 60]) == (0, 255, 0)  # its cap, in front of the outer one's
    assert tuple(opened[50, 60 + 25]) == (0, 0, 255)  # 5 mm from the middle


def test_transparent_skin_blends_with_what_is_inside():
    inside, skin = Drawable(sphere(3), GREEN), Drawable(sphere(8), RED, opacity=0.25)
    alone = render([inside], CAMERA, SIZE)[50, 60].astype(float)
    lit = render([Drawable(sphere(8), RED)], CAMERA, SIZE)[50, 60].astype(float)
    veil = render([skin], CAMERA, SIZE)[50, 60].astype(float)
    both = render([inside, skin], CAMERA, SIZE)[50, 60].astype(float)
    np.testing.assert_allclose(veil, 0.25 * lit + 0.75 * 255, atol=4)
    np.testing.assert_allclose(both, 0.25 * lit + 0.75 * alone, atol=4)


def test_a_lifted_cloth_covers_a_body_that_penetrates_it():
    organ, size = Drawable(sphere(5), GREEN), (60, 50)
    below = Drawable(sphere(4.8), RED, opacity=0.5)
    above = Drawable(sphere(4.8), RED, opacity=0.5, lift=0.5)
    bare = render([organ], CAMERA, size)[25, 30].astype(int)
    assert np.abs(render([organ, below], CAMERA, size)[25, 30].astype(int) - bare).max() < 3
    assert render([organ, above], CAMERA, size)[25, 30].astype(int)[0] > bare[0] + 60


def test_cut_shows_the_section_disc():
    # what is left is z < 4: the section's radius is sqrt(49 - 16)
    cut, fine = Cut(np.array([0.0, 0, 4]), np.array([0.0, 0, 1])), (480, 400)
    opened = render([Drawable(sphere(7), RED)], CAMERA, fine, cut)
    y, x = (np.indices((400, 480)) + 0.5) * 20 / 400 - np.array([10, 12])[:, None, None]
    radius, section = np.hypot(x, y), np.sqrt(33)
    assert np.ptp(opened[radius < section - 0.2], axis=0).max() == 0
    assert opened[(radius > section + 0.2) & (radius < 6.8)].astype(int)[:, 0].min() < 250


def test_fitted_camera_sees_everything():
    bodies = [Drawable(sphere(2, (30, 0, 4)), RED), Drawable(sphere(4, (-9, 5, 1)), GREEN)]
    points = [body.surface.vertices for body in bodies]
    camera = Camera.fit(points, np.array([1.0, 1, -1]), np.array([0.0, 0, 1]), SIZE)
    seen = render(bodies, camera, SIZE).min(axis=2) < 128
    assert seen.any() and not (seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any())
    area = seen.sum() * (camera.height / SIZE[1]) ** 2
    assert area == pytest.approx(np.pi * (4 + 16), rel=0.03)


def test_two_pictures_of_the_same_bodies_are_equal_and_a_bar_is_beside_them():
    bar = ColourBar("mm", 0.0, 2.0)
    np.testing.assert_allclose(bar.colours(np.array([-1.0, 9.0])), bar.colours(np.array([0.0, 2.0])))
    bodies = [Drawable(sphere(4), bar.colours(np.linspace(0, 2, len(sphere(4).vertices))))]
    plain, again = (render(bodies, CAMERA, (240, 200)) for _ in range(2))
    np.testing.assert_array_equal(plain, again)
    barred = render(bodies, CAMERA, (240, 200), bar=bar)
    changed = np.argwhere((barred != plain).any(axis=2))
    assert changed[:, 1].min() > 160
    strip = barred[:, 200:].reshape(-1, 3).astype(int)
    for end in bar.colours(np.array([0.0, 2.0])):
        assert np.abs(strip - 255 * end).max(axis=1).min() < 8


def test_a_volume_is_seen_where_its_values_are_and_by_its_transfer_function():
    values = np.zeros((40, 30, 20), np.float32)
    values[10:30, 10:20, 5:15] = 1.0  # a box of 10 x 5 x 5 mm about the middle
    affine = np.diag([0.5, 0.5, 0.5, 1.0])
    affine[:3, 3] = -0.5 * np.array([19.5, 14.5, 9.5])
    solid = Transfer(((0.0, RED, 0.0), (0.49, RED, 0.0), (0.51, RED, 1.0)))
    seen = render_volume(Volume(values, affine), solid, 1.0, CAMERA, SIZE).astype(int)
    inside = seen[..., 1] < 128
    assert inside.sum() * PIXEL**2 == pytest.approx(50, rel=0.08)
    assert np.argwhere(inside).mean(axis=0) == pytest.approx([49.5, 59.5], abs=0.6)
    faint = Volume(0.5 * values, affine)  # muscle beside fat: only all tissues show it
    anatomy, fat = (render_volume(faint, TRANSFERS[name], 1.0, CAMERA, SIZE) for name in ("anatomy", "fat"))
    assert (anatomy < 250).any() and fat.min() > 250


def test_a_movie_has_every_picture_for_its_time(tmp_path: Path):
    pictures = [np.full((20, 30, 3), 40 * k, np.uint8) for k in range(5)]
    write_movie(tmp_path / "a.webp", iter(pictures), len(pictures), fps=25.0)
    with images.open(tmp_path / "a.webp") as movie:
        assert (movie.n_frames, movie.size) == (5, (30, 20))
        for number, picture in enumerate(pictures):
            movie.seek(number)
            movie.load()
            assert movie.info["duration"] == 40
            assert abs(int(np.asarray(movie.convert("RGB")).mean()) - int(picture.mean())) < 6


def test_a_movie_keeps_no_picture_but_the_one_that_is_encoded(tmp_path: Path):
    """Pillow alone would keep all of them: here 60 of 2.8 MB."""

    def pictures():
        for number in range(60):
            picture = np.full((960, 960, 3), 255, np.uint8)
            picture[10 * number : 10 * number + 300, 300:600] = 100
            held.append(tracemalloc.get_traced_memory()[0])
            yield picture

    held: list[int] = []
    tracemalloc.start()
    write_movie(tmp_path / "a.webp", pictures(), 60)
    tracemalloc.stop()
    assert len(held) == 60 and held[-1] < held[3] + 2.8e6


def test_a_movie_of_too_few_pictures_is_no_file(tmp_path: Path):
    with pytest.raises(ValueError, match="2 pictures in place of 3"):
        write_movie(tmp_path / "a.webp", iter([np.zeros((8, 8, 3), np.uint8)] * 2), 3)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="VTK's own window elsewhere")
def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch):
    window._kind.cache_clear()
    monkeypatch.setattr(window, "KINDS", dict.fromkeys(window.KINDS, ("libAbsent.so.1",)))
    with pytest.raises(InputError, match="apt-get install libegl1"):
        render([Drawable(sphere(1), RED)], CAMERA, SIZE)
    window._kind.cache_clear()
