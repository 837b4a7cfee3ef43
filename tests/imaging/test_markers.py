import json

import numpy as np
import pytest
from phalanx import grid_points, voxelised

from handpipe.core.errors import InputError
from handpipe.imaging.bone_surfaces.marrow import contour
from handpipe.imaging.evidence.markers import (
    boundary_markers,
    estimate_muscle_level,
    read_markers,
    write_markers,
)
from handpipe.mesh.surfaces.distance import Distance

MUSCLE, CONTACT, BONE = 0.45, -2.5, 7.0


def muscle(points):
    """An ellipsoid, negative inside; near its surface nearly a distance."""
    scaled = points / np.array([9.0, 5.0, 4.0])
    return np.linalg.norm(scaled, axis=-1) - 1


def intensity(points):
    """A muscle in fat, on another muscle below z = CONTACT, cut by dark bone beyond x = BONE."""
    value = np.where(points[..., 2] < CONTACT, MUSCLE, 0.9)
    value = np.where(muscle(points) < 0, MUSCLE, value)
    return np.where(points[..., 0] > BONE, 0.06, value)


@pytest.fixture(scope="module")
def image():
    volume = voxelised(intensity, (-13, -9, -8), (12, 9, 8), noise=0.03)
    return volume, contour(volume.like(-muscle(grid_points(volume))), 0.0)


GUESSES = {"exact": (1.0, (0, 0, 0)), "small": (0.9, (0.7, 0.6, 0.3)), "large": (1.15, (-1.0, 0.5, 0.3))}


@pytest.mark.parametrize("guess", GUESSES)
def test_markers_lie_on_the_muscle_below_the_voxel_size(image, guess) -> None:
    volume, truth = image
    scale, shift = GUESSES[guess]
    markers = boundary_markers(volume, truth.moved(truth.vertices * scale + np.array(shift)))
    to_muscle = np.abs(Distance(truth).signed(markers.points)[0])
    to_bone = np.where(muscle(markers.points) < 0, np.abs(markers.points[:, 0] - BONE), np.inf)
    error = np.minimum(to_muscle, to_bone)
    assert len(markers.points) > 1000
    assert error.mean() < 0.1
    assert np.quantile(error, 0.98) < 0.3
    assert (to_bone < 0.2).sum() > 50


@pytest.mark.parametrize("guess", GUESSES)
def test_no_marker_where_muscles_touch(image, guess) -> None:
    volume, truth = image
    scale, shift = GUESSES[guess]
    markers = boundary_markers(volume, truth.moved(truth.vertices * scale + np.array(shift)))
    inside_contact = (markers.points[:, 2] < CONTACT - 0.6) & (markers.points[:, 0] < BONE - 0.6)
    assert inside_contact.sum() == 0


def test_no_marker_in_an_image_of_noise(image) -> None:
    volume, truth = image
    noise = MUSCLE + 0.03 * np.random.default_rng(0).standard_normal(volume.shape)
    assert len(boundary_markers(volume.like(noise), truth).points) == 0


def test_none_where_forbidden(image) -> None:
    volume, truth = image
    forbidden = truth.vertices[:, 1] > 0
    markers = boundary_markers(volume, truth, forbid=forbidden)
    assert len(markers.points) > 300
    assert not forbidden[markers.vertices].any()


def test_muscle_level_is_estimated_in_a_poor_guess(image) -> None:
    volume, truth = image
    poor = truth.moved(truth.vertices * 1.15 + np.array([-1.0, 1.0, 0.5]))
    assert abs(estimate_muscle_level(volume, poor) - MUSCLE) < 0.03


def test_markups_return_from_their_file(tmp_path) -> None:
    points = np.random.default_rng(0).normal(size=(4, 3))
    write_markers(tmp_path / "a.mrk.json", points, ["a", "b", "c", "d"], kind="Curve")
    again, labels = read_markers(tmp_path / "a.mrk.json")
    np.testing.assert_allclose(again, points)
    assert labels == ["a", "b", "c", "d"]


def test_lps_markups_are_turned_to_ras(tmp_path) -> None:
    path = tmp_path / "lps.mrk.json"
    point = {"label": "x", "position": [1.0, 2.0, 3.0]}
    path.write_text(json.dumps({"markups": [{"coordinateSystem": "LPS", "controlPoints": [point]}]}))
    np.testing.assert_array_equal(read_markers(path)[0], [[-1.0, -2.0, 3.0]])


@pytest.mark.parametrize(
    ("content", "field"),
    [
        (None, "file"),
        ("{", "JSON"),
        ("[]", "markups"),
        ('{"markups": [{"coordinateSystem": "RAS", "controlPoints": []}]}', "controlPoints"),
        ('{"markups": [{"coordinateSystem": "XYZ"}]}', "markups[0].coordinateSystem"),
        ('{"markups": [{"coordinateSystem": "RAS", "coordinateUnits": "m"}]}', "markups[0].coordinateUnits"),
        (
            '{"markups": [{"coordinateSystem": "RAS", "controlPoints": [{"label": "a"}]}]}',
            "markups[0].controlPoints[0].position",
        ),
        (
            '{"markups": [{"coordinateSystem": "RAS", "controlPoints": [{"position": [1, 2]}]}]}',
            "markups[0].controlPoints[0].position",
        ),
        (
            '{"markups": [{"coordinateSystem": "RAS", "controlPoints": [{"position": [1, 2, NaN]}]}]}',
            "markups[0].controlPoints[0].position",
        ),
    ],
)
def test_bad_markups_are_named(tmp_path, content, field) -> None:
    path = tmp_path / "bad.mrk.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError) as caught:
        read_markers(path)
    assert caught.value.field == field
