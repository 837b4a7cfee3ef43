"""Feature points from a photograph that is made by projecting known ones."""

import numpy as np
import pytest
from tests.anatomy.hand_templates import furnished

from handpipe.anatomy.person import photograph as photographs
from handpipe.anatomy.person.subject_template import warped
from handpipe.anatomy.person.warp import biharmonic_warp, require_invertible
from handpipe.core.errors import InputError


@pytest.fixture(scope="module")
def template():
    return furnished()


def camera(points, template, mirrored: bool, pixels_a_mm: float = 7.5):
    """Pixels of an orthographic view onto the back of points (n, 3), straight down onto the hand's plane."""
    own = np.array(list(template.feature_points.values()))
    axes = np.linalg.svd(own - own.mean(axis=0))[2]
    if np.linalg.det([axes[0], axes[1], [0.0, 0.0, 1.0]]) < 0:
        axes[1] *= -1
    flat = points @ axes[:2].T @ [[np.cos(0.9), np.sin(0.9)], [-np.sin(0.9), np.cos(0.9)]]
    return pixels_a_mm * flat * [-1.0 if mirrored else 1.0, -1.0] + [2000.0, 1500.0]


def clicked(points, template, mirrored: bool = False, distance: float = 200.0):
    pixels = camera(np.array(list(points.values())), template, mirrored)
    return photographs.Photograph(
        points={n: tuple(map(float, p)) for n, p in zip(points, pixels, strict=True)},
        ruler=((100.0, 200.0), (100.0 + 900.0, 200.0 + 1200.0)),  # 1500 pixels, 200 mm
        distance=distance,
    )


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("size", [1.0, 0.6])
def test_a_photograph_of_the_template_gives_it_back(template, mirrored, size):
    person = {n: size * p for n, p in template.feature_points.items()}
    found = photographs.from_photograph(template, clicked(person, template, mirrored))
    assert found.mirrored == mirrored and found.residual < 1e-6
    assert found.size == pytest.approx(size, rel=1e-9)
    middle = np.mean(list(template.feature_points.values()), axis=0)
    for name, point in template.feature_points.items():
        assert found.points[name] == pytest.approx(middle + size * (point - middle), abs=1e-6), name
    warp = biharmonic_warp(template.feature_points, found.points)
    require_invertible(warp, template, "photograph")
    volume = warped(template, warp).bones["proximal3"].volume()
    assert volume == pytest.approx(size**3 * template.bones["proximal3"].volume(), rel=1e-6)


def test_a_photograph_with_sixteen_points_and_longer_fingers(template):
    longer = {
        n: p + ([8.0, 0, 0] if n in ("tip3", "DIP3", "PIP3") else [0.0, 0, 0])
        for n, p in template.feature_points.items()
    }
    kept = {n: p for n, p in longer.items() if not n.startswith(("web", "DIP")) or n == "DIP3"}
    found = photographs.from_photograph(template, clicked(kept, template))
    assert len(found.points) == len(kept) == 16
    lengths = [np.linalg.norm(p["tip3"] - p["MP3"]) for p in (found.points, longer)]
    assert lengths[0] == pytest.approx(lengths[1], abs=1.5)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"distance": 20.0}, "ruler: makes the hand 0.10 times as large"),
        ({"mix": True}, "names are mixed up"),
        ({"few": True}, "at least 8"),
    ],
)
def test_photographs_that_cannot_be_are_refused(template, change, match):
    points = dict(template.feature_points)
    if change.get("mix"):
        rolled = dict(zip(points, list(points.values())[::-1], strict=True))
        points = {n: rolled[n] for n in points}
    if change.get("few"):
        points = {n: points[n] for n in ("tip1", "tip2", "tip3", "tip4", "tip5")}
    with pytest.raises(InputError, match=match):
        photographs.from_photograph(
            template, clicked(points, template, distance=change.get("distance", 200.0))
        )


def test_what_was_clicked_is_read_and_checked(tmp_path, template):
    photo = clicked(template.feature_points, template)
    path = tmp_path / "photo.yaml"
    path.write_text(photo.model_dump_json(), encoding="utf-8")
    assert photographs.read_photograph(path) == photo
    assert photo.scale == pytest.approx(1 / 7.5)
    path.write_text(photo.model_dump_json().replace('"tip1"', '"thumb"'), encoding="utf-8")
    with pytest.raises(InputError, match="'thumb' is no feature point"):
        photographs.read_photograph(path)
