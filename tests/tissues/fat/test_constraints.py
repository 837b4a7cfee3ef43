"""Which points hold the tissue, and where the limb was cut off."""

import numpy as np
from tests.mesh.shapes import sphere

from handpipe.core.layers import Region, Shape
from handpipe.mesh.surfaces.surface import Surface, concatenate
from handpipe.tissues.fat.constraints import cut_ends, default_region, inner_points


def _shape(surface, **fields):
    return Shape(surface.vertices, surface.vertices, surface.triangles, fields)


def test_only_what_lies_on_the_inner_surface_holds_the_tissue():
    large = sphere(5.0, 3)
    buried = sphere(2.0, 2)
    half = large.vertices[:, 0] > 0
    below = {
        "bones": {"shown": _shape(large, region=np.where(half, Region.fixed, Region.sliding))},
        "tendons": {"buried": _shape(buried)},
    }
    points = inner_points(below, ("bones", "tendons", "absent"), large, 0.2)
    assert points.bodies == ("shown", "buried") and points.layers == ("bones", "tendons")
    np.testing.assert_array_equal(points.rest, large.vertices)
    np.testing.assert_array_equal(points.region == Region.fixed, half)
    np.testing.assert_allclose(points.normal, large.vertices / 5.0, atol=0.02)
    np.testing.assert_allclose(points.area.sum(), large.area(), rtol=1e-9)


def test_sliding_gives_way_to_contact_in_valleys():
    ball = sphere(5.0, 4)
    other = ball.moved(ball.vertices + [12.0, 0, 0])
    below = {"muscles": {n: _shape(s) for n, s in (("left", ball), ("right", other))}}
    for shape in below["muscles"].values():
        shape.fields["region"] = np.full(len(shape.vertices), Region.sliding)
    points = inner_points(below, ("muscles",), concatenate([ball, other]), 0.1, valley=1.5)
    # A ball above a point of one sphere must clear the other: |c + 6.5 n - c'| > 5 + 0.9 * 1.5
    centres = np.array([[0.0, 0, 0], [12.0, 0, 0]])
    above = centres[points.body] + 6.5 * points.normal
    clearance = np.linalg.norm(above - centres[1 - points.body], axis=1) - 5.0 - 0.9 * 1.5
    clear = np.abs(clearance) > 0.1
    np.testing.assert_array_equal(points.region[clear] == Region.sliding, clearance[clear] > 0)
    assert (points.region == Region.contact).sum() > 20


def test_bodies_without_regions_touch_but_bones_are_grown_on():
    assert default_region("bones") is Region.fixed
    assert default_region("tendons") is Region.contact
    ball = sphere(3.0, 2)
    curve = Shape(ball.vertices[:2], ball.vertices[:2], np.array([[0, 1]]))
    points = inner_points({"tendons": {"tube": _shape(ball), "rod": curve}}, ("tendons",), ball, 0.2)
    assert points.bodies == ("tube",)
    assert (points.region == Region.contact).all()


def test_a_small_hole_of_the_scan_is_no_cut():
    skin = sphere(10.0, 4)
    x = skin.vertices[:, 0]
    open_end, small_hole = x < -6.0, (x > 9.7)
    covered = ~(open_end | small_hole)[skin.triangles].any(axis=1)
    scan = Surface(skin.vertices, skin.triangles[covered]).compact()
    [found] = cut_ends(skin, scan, 0.3)
    assert open_end[found].all() and np.isin(np.flatnonzero(x < -7.0), found).all()


def test_a_limb_is_cut_at_both_ends_whatever_joins_them():
    skin = sphere(10.0, 4)
    x = skin.vertices[:, 0]
    ends, hole = (x < -6.0) | (x > 7.0), skin.vertices[:, 1] > 9.0
    covered = ~(ends | hole)[skin.triangles].any(axis=1)
    larger, smaller = cut_ends(skin, Surface(skin.vertices, skin.triangles[covered]).compact(), 0.3)
    assert np.isin(np.flatnonzero(x < -7.0), larger).all() and (x[larger] < -6.0).all()
    assert np.isin(np.flatnonzero(x > 8.0), smaller).all() and (x[smaller] > 7.0).all()


def test_a_scan_without_openings_has_no_cut_end():
    skin = sphere(10.0, 3)
    assert cut_ends(skin, skin, 0.5) == []
    assert cut_ends(skin, concatenate([skin, sphere(3.0, 2)]), 0.5) == []
