import numpy as np
import pytest

from handpipe.mesh.surfaces.curves import (
    arclength,
    bishop_frames,
    closest_on_polyline,
    resample,
    tangents,
    tube,
)


@pytest.fixture
def helix():
    t = np.linspace(0, 4 * np.pi, 400)
    return np.stack([3 * np.cos(t), 3 * np.sin(t), 0.5 * t], axis=1)


def test_length_of_a_helix(helix):
    assert arclength(helix)[-1] == pytest.approx(4 * np.pi * np.sqrt(9.25), rel=1e-4)


def test_resampling_is_even_and_keeps_the_ends(helix):
    points = resample(helix, 50)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.ptp(steps) < 1e-3 * steps.mean()
    np.testing.assert_allclose(points[[0, -1]], helix[[0, -1]])


def test_smooth_resampling_rounds_a_coarse_circle():
    angle = np.linspace(0, np.pi, 9)
    coarse = 10 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    radii = [np.linalg.norm(resample(coarse, 100, smooth=s), axis=1)[10:-10] for s in (False, True)]
    assert np.abs(radii[1] - 10).max() < 0.1 * np.abs(radii[0] - 10).max()


def test_bishop_frames_turn_about_a_helix_by_its_torsion(helix):
    frames = bishop_frames(helix, np.array([1.0, 0, 0.3]))
    np.testing.assert_allclose(
        frames @ np.swapaxes(frames, 1, 2), np.broadcast_to(np.eye(3), frames.shape), atol=1e-12
    )
    np.testing.assert_allclose(frames[:, 0], tangents(helix), atol=1e-12)
    t = np.linspace(0, 4 * np.pi, 400)
    inwards = -np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)  # the Frenet normal
    angle = np.unwrap(
        np.arctan2(np.einsum("ij,ij->i", inwards, frames[:, 2]), np.einsum("ij,ij->i", inwards, frames[:, 1]))
    )
    torsion = 0.5 / (3**2 + 0.5**2)
    assert angle[-1] - angle[0] == pytest.approx(torsion * arclength(helix)[-1], rel=0.01)


def test_frames_of_a_straight_line_are_constant():
    line = np.outer(np.arange(5.0), [1, 2, 2])
    frames = bishop_frames(line, np.array([0, 1.0, 0]))
    np.testing.assert_allclose(frames, np.broadcast_to(frames[0], frames.shape), atol=1e-14)


def test_closest_points_on_a_corner():
    corner = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0]])
    queries = np.array([[1.0, -2, 0], [5, 3, 0], [-1, 0, 0], [6, -1, 0]])
    segment, t, point, distance = closest_on_polyline(queries, corner)
    assert list(segment[:3]) == [0, 1, 0]
    assert t[:3] == pytest.approx([0.25, 0.75, 0])
    np.testing.assert_allclose(point, [[1, 0, 0], [4, 3, 0], [0, 0, 0], [4, 0, 0]])
    assert distance == pytest.approx([2, 1, 1, np.sqrt(5)])


def test_a_tube_is_closed_and_has_the_volume_of_its_prism():
    line = np.stack([np.linspace(0, 10, 6), np.zeros(6), np.zeros(6)], axis=1)
    surface = tube(line, bishop_frames(line, np.array([0, 1.0, 0])), np.full(6, 2.0), 16)
    assert surface.is_closed()
    assert surface.volume() == pytest.approx(10 * 0.5 * 16 * 4 * np.sin(2 * np.pi / 16))
