"""Surfaces of the shared cases, as other programs write them, against the sphere that they show."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from handpipe.core.errors import InputError
from handpipe.mesh.files import read_scan, read_surface, write_surface
from handpipe.mesh.surfaces.surface import Surface, concatenate

CASES = Path(__file__).parents[3] / "shared" / "cases"
DIALECTS = sorted((CASES / "ply-dialects").glob("*.[po][lb][yj]"))

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="the shared cases are not beside the checkout")


@pytest.mark.parametrize("path", DIALECTS, ids=lambda p: p.name)
def test_every_dialect_is_the_sphere(path: Path) -> None:
    surface = read_surface(path, closed=True)
    assert len(surface.vertices) == 258
    assert np.linalg.norm(surface.vertices, axis=1) == pytest.approx(np.full(258, 10.0), rel=1e-5)
    hull = trimesh.Trimesh(surface.vertices).convex_hull
    flat = 2e-3 if "hexagon" in path.name else 1e-6  # the hexagon cuts a little of the sphere away
    assert surface.volume() == pytest.approx(hull.volume, rel=flat)
    assert surface.area() == pytest.approx(hull.area, rel=flat)


def with_island(share: float) -> Surface:
    """The case's island: a sphere of a share of the scan's area, 40 mm beside its centre."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    scan = Surface(15.0 * ball.vertices, ball.faces)
    radius = np.sqrt(share * scan.area() / (4 * np.pi))
    return concatenate([scan, Surface(ball.vertices * radius + [0, 40, 0], ball.faces)])


def test_an_island_is_named(tmp_path: Path) -> None:
    write_surface(tmp_path / "scan.ply", with_island(0.03))
    with pytest.raises(InputError) as caught:
        read_scan(tmp_path / "scan.ply")
    assert caught.value.source.endswith("scan.ply")
    assert "1 of 2 parts touch no other: 2.9 % of the area near (0, 40, 0)" in caught.value.problem


def test_dust_is_left_out_with_a_word(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_surface(tmp_path / "scan.ply", with_island(0.003))
    scan = read_scan(tmp_path / "scan.ply")
    assert len(scan.vertices) == 642
    assert scan.area() == pytest.approx(with_island(0.003).components()[0].area())
    assert "1 loose parts" in caplog.text
    assert "near (0, 40, 0)" in caplog.text
