import numpy as np
import pytest
from phalanx import Phalanx, grid_points, voxelised

from handpipe.core.errors import InputError
from handpipe.imaging.bone_surfaces.marrow import contour
from handpipe.imaging.evidence.tubes import darkness_centre, parallel_frames, tangents_of, trace, tube_surface
from handpipe.mesh.surfaces.distance import Distance

BEND = 25.0  # mm, radius of the tube's course
RADIUS = 1.5


def course(angle):
    return np.stack([BEND * np.sin(angle), BEND * (1 - np.cos(angle)), 0 * angle], axis=1)


def to_tube(points):
    """Distance from the circular course less the radius."""
    from_axis = np.hypot(points[..., 0], points[..., 1] - BEND) - BEND
    return np.hypot(from_axis, points[..., 2]) - RADIUS


@pytest.fixture(scope="module")
def bent():
    """A dark tube along an arc, fat above and muscle below it."""

    def intensity(points):
        return np.where(to_tube(points) < 0, 0.08, np.where(points[..., 2] > 0, 0.9, 0.45))

    return voxelised(intensity, (-1, -5, -5), (19, 14, 5))


def test_trace_follows_the_tube(bent) -> None:
    clicked = course(np.array([0.05, 0.35, 0.7])) + np.array([[0, 0.5, 0.4], [0, -0.4, 0.3], [0.3, 0, -0.4]])
    found = trace(bent, clicked)
    assert to_tube(found).max() < -0.5
    assert np.linalg.norm(found[0] - clicked[0]) < 1
    assert np.linalg.norm(found[-1] - clicked[-1]) < 1


def test_centres_are_found_between_unlike_neighbours(bent) -> None:
    guess = course(np.linspace(0.1, 0.65, 25)) + np.array([0.3, -0.4, 0.5])
    sections = darkness_centre(bent, guess, tangents_of(guess), 1.7)
    from_course = to_tube(sections.centres) + RADIUS
    assert from_course.mean() < 0.08
    assert from_course.max() < 0.2
    assert np.abs(sections.radii - RADIUS).max() < 0.2
    assert sections.confidence.min() > 0.5


def test_a_place_without_a_tube_has_no_confidence(bent) -> None:
    guess = course(np.linspace(0.2, 0.5, 9)) + np.array([0, 0, 3.9])
    sections = darkness_centre(bent, guess, tangents_of(guess), 0.6)
    assert sections.confidence.max() < 0.2


def test_a_strip_of_muscle_is_no_tendon() -> None:
    def intensity(points):
        return np.where(to_tube(points) < 0, 0.45, 0.9)

    guess = course(np.linspace(0.1, 0.65, 25)) + np.array([0.3, -0.4, 0.5])
    strip = voxelised(intensity, (-1, -5, -5), (19, 14, 5))
    sections = darkness_centre(strip, guess, tangents_of(guess), 1.7)
    assert sections.confidence.max() < 0.05
    np.testing.assert_allclose(sections.centres, guess, atol=0.2)


def test_a_bright_strand_in_a_dark_sheath_is_no_tendon() -> None:
    def intensity(points):
        return np.where(np.abs(to_tube(points) + 0.4) < 0.4, 0.08, 0.9)

    guess = course(np.linspace(0.1, 0.65, 25))
    sheath = voxelised(intensity, (-1, -5, -5), (19, 14, 5))
    assert darkness_centre(sheath, guess, tangents_of(guess), 1.5).confidence.max() == 0.0


def test_surface_is_closed_and_below_the_voxel_size(bent) -> None:
    surface = tube_surface(bent, course(np.linspace(0.1, 0.65, 30)), 1.7)
    sides = surface.vertices[:-2]
    assert surface.is_closed()
    assert surface.volume() > 0
    assert np.abs(to_tube(sides)).mean() < 0.1


def test_a_bone_that_touches_hides_no_centre() -> None:
    phalanx = Phalanx()
    volume = phalanx.volume()
    bone = contour(volume.like(-phalanx.bone(grid_points(volume))), 0.0)
    z = -(phalanx.marrow_radius + 1.1 + phalanx.tendon_radius - 0.1)
    guess = np.stack([np.linspace(-12, 12, 40), np.full(40, 0.4), np.full(40, z - 0.4)], axis=1)
    sections = darkness_centre(volume, guess, tangents_of(guess), 1.8, Distance(bone))
    assert np.hypot(sections.centres[:, 1], sections.centres[:, 2] - z).max() < 0.15
    surface = tube_surface(volume, sections.centres, 1.5, Distance(bone))
    assert Distance(bone).signed(surface.vertices)[0].min() > -0.02
    assert np.abs(phalanx.tendon(surface.vertices[:-2])).mean() < 0.12


def test_frames_turn_no_more_than_the_curve() -> None:
    tangents = tangents_of(course(np.linspace(0, 2, 50)))
    first, second = parallel_frames(tangents)
    np.testing.assert_allclose(np.einsum("ij,ij->i", first, tangents), 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(second, axis=1), 1, atol=1e-12)
    # a plane curve: the normal out of its plane stays what it is
    out = first @ np.array([0, 0, 1.0])
    np.testing.assert_allclose(out, out[0], atol=1e-9)


def test_points_outside_the_volume_are_named(bent) -> None:
    with pytest.raises(InputError) as caught:
        trace(bent, np.array([[0.0, 0, 0], [100, 0, 0]]))
    assert caught.value.field == "points"
