"""Polygons are cut into triangles that cover them once."""

import numpy as np
import pytest

from handpipe.mesh.files.polygons import NotSimple, Polygons, triangulate

STAR = np.array(
    [
        [np.cos(a) * r, np.sin(a) * r, 0.3 * np.cos(a) * r]
        for a, r in zip(np.arange(10) * np.pi / 5, [5, 2] * 5, strict=True)
    ]
)


def area(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return np.cross(b - a, c - a) / 2


def shoelace(points: np.ndarray) -> np.ndarray:
    return np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2


@pytest.mark.parametrize("first", range(10))
@pytest.mark.parametrize("turn", [1, -1])
def test_a_star_is_covered_once(first: int, turn: int) -> None:
    """The sum of the triangles' area vectors is right for any cut; no triangle faces the other way."""
    corners = np.roll(np.arange(10), first)[::turn]
    triangles = triangulate(STAR, Polygons(corners, np.array([10])))
    assert len(triangles) == 8
    parts = area(STAR, triangles)
    whole = shoelace(STAR[corners])
    assert parts.sum(axis=0) == pytest.approx(whole)
    assert (parts @ whole > 0).all()
    assert np.linalg.norm(parts, axis=1).sum() == pytest.approx(np.linalg.norm(whole))


def test_triangles_keep_the_order_of_the_polygons() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
    polygons = Polygons(np.array([1, 4, 2, 0, 1, 2, 3, 0, 1]), np.array([3, 4, 2]))
    assert triangulate(square, polygons).tolist() == [[1, 4, 2], [0, 1, 2], [0, 2, 3]]


def test_a_polygon_that_crosses_itself_is_named() -> None:
    bow = np.array([[0.0, 0, 0], [9, 9, 0], [9, 0, 0], [0, 7, 0], [4, 9, 0]])
    with pytest.raises(NotSimple, match="polygon 1"):
        triangulate(bow, Polygons(np.array([0, 2, 1, 0, 1, 2, 3, 4]), np.array([3, 5])))
