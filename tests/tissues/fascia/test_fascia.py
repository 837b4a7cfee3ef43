"""Cloth around two capsules that meet, at rest and bent at the joint between them."""

from functools import cache

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from tests.mesh.shapes import sphere

from handpipe.core.errors import InputError
from handpipe.core.layers import Frame, Region, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.cloth import Membrane
from handpipe.mesh.contact.self_cuts import cuts_itself
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.posing.layer import BoneLayer, bone_regions
from handpipe.tissues.fascia.fascia import THICKNESS, ClothSettings, Fascia
from handpipe.tissues.fascia.layer import FasciaLayer
from handpipe.tissues.fascia.regions import muscle_regions, read_regions, slender
from handpipe.tissues.fascia.wrapping import bone_wrap, wrap

RADIUS, LENGTH, GAP = 4.0, 16.0, 1.0


@cache
def _capsules():
    """Two along x, a gap of 1 mm between their ends at x = 0."""
    mesh = trimesh.creation.capsule(height=LENGTH, radius=RADIUS, count=[24, 24])
    vertices = np.array(mesh.vertices)[:, [2, 0, 1]]
    vertices[:, 0] -= vertices[:, 0].min()
    right = remesh(Surface(vertices + [GAP / 2, 0, 0], np.array(mesh.faces, dtype=np.int64)), 1.2)
    left = right.moved(right.vertices * [-1, 1, 1]).flipped()
    return {"left": left, "right": right}


@cache
def _fascia():
    bones = _capsules()
    surface = bone_wrap(bones, [("left", "right")], 1.5)
    regions = bone_regions(surface.vertices, bones, 5.0, 0.5)
    return Fascia.around("bone_fascia", surface, regions, bones, ClothSettings())


def _frame(degrees):
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    moved = RigidTransform.about(np.zeros(3), turn)
    return Frame("bent", {}, {"left": RigidTransform.identity(), "right": moved})


@cache
def _solved(degrees):
    frame = _frame(degrees)
    below = {"bones": BoneLayer(_capsules()).solve(frame, {})}
    [shape] = FasciaLayer(_fascia(), "bones").solve(frame, below).values()
    return shape, {n: Surface(s.vertices, s.cells) for n, s in below["bones"].items()}


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_fixed_vertices_follow_their_bones_and_the_rest_stays_outside(degrees):
    fascia, (shape, posed) = _fascia(), _solved(degrees)
    rest = _capsules()
    fixed = fascia.regions == Region.fixed
    assert fixed.any() and (~fixed).any()
    carried = fascia.carried(rest, posed)
    assert np.linalg.norm(shape.vertices - carried, axis=1)[fixed].max() < 1e-9
    outside = np.min([Distance(s).signed(shape.vertices[~fixed])[0] for s in posed.values()], axis=0)
    assert outside.min() > -0.05


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_the_cloth_is_in_tension(degrees):
    fascia, (shape, _) = _fascia(), _solved(degrees)
    settings = fascia.settings
    material = Material(settings.young, settings.poisson)
    drawn = fascia.surface
    membrane = Membrane(drawn.vertices, drawn.triangles, material, THICKNESS, settings.shrink)
    assert membrane.stretches(shape.vertices).min() > 1.0


def test_a_cloth_fixed_everywhere_goes_where_it_is_carried():
    bones = _capsules()
    right = bones["right"]
    fascia = Fascia.around(
        "held", right, np.full(len(right.vertices), Region.fixed), {"right": right}, ClothSettings()
    )
    moved = _frame(40.0).bones["right"]
    posed = {"right": right.moved(moved(right.vertices))}
    x = fascia.solve({"right": right}, posed, right.vertices)
    assert np.linalg.norm(x - posed["right"].vertices, axis=1).max() < 1e-9


def test_a_sliding_cloth_does_not_turn_with_its_body():
    right = _capsules()["right"]
    x = right.vertices[:, 0]
    ends = (x < x.min() + 3.0) | (x > x.max() - 3.0)
    turn = RigidTransform(Rotation.from_rotvec([0.6, 0, 0]).as_matrix(), np.zeros(3))
    posed = {"right": right.moved(turn(right.vertices))}
    regions = np.where(x < x.min() + 3.0, Region.fixed, Region.sliding)
    fascia = Fascia.around("slides", right, regions, {"right": right}, ClothSettings())
    assert not fascia.tied[~ends].any()
    middle = np.abs(x - x.mean()) < 2.0
    solved = fascia.solve({"right": right}, posed, right.vertices)
    assert np.abs(Distance(posed["right"]).signed(solved[~ends])[0]).max() < 0.05
    still = np.linalg.norm(solved - right.vertices, axis=1)[middle]
    assert still.mean() < 2 * RADIUS * np.sin(0.3) + 0.05


def folded(points, degrees=100.0, arc=3.0):
    """A straight body along x bent at its middle until its two arms lie in one another."""
    half = np.radians(degrees)
    turn = np.clip(points[:, 0] / arc, -half, half)
    beyond = points[:, 0] - arc * turn  # straight on, from the ends of the arc
    across = arc - points[:, 1]
    return np.column_stack(
        [
            across * np.sin(turn) + beyond * np.cos(turn),
            arc - across * np.cos(turn) + beyond * np.sin(turn),
            points[:, 2],
        ]
    )


def test_a_cloth_comes_to_rest_on_a_body_that_folds_into_itself():
    mesh = trimesh.creation.capsule(height=30.0, radius=RADIUS, count=[24, 24])
    vertices = np.array(mesh.vertices)[:, [2, 0, 1]]
    vertices[:, 0] -= vertices[:, 0].mean()
    body = remesh(Surface(vertices, np.array(mesh.faces, dtype=np.int64)), 1.0)
    posed = body.moved(folded(body.vertices))
    assert cuts_itself(posed) and not cuts_itself(body)
    surface = bone_wrap({"body": body}, [], 1.5)
    regions = np.where(np.abs(surface.vertices[:, 0]) > 14.0, Region.fixed, Region.contact)
    fascia = Fascia.around("folded", surface, regions, {"body": body}, ClothSettings())
    x = fascia.solve({"body": body}, {"body": posed}, folded(surface.vertices))
    free = ~fascia.tied & (regions == Region.contact)
    assert Distance(posed).depths(x[free]).max() < 0.2


def test_slender_parts_are_those_where_no_ball_fits():
    thick, thin = sphere(3.0, 3), sphere(1.5, 3)
    bodies = {"thick": thick, "thin": thin.moved(thin.vertices + [20.0, 0, 0])}
    points = np.concatenate([s.vertices for s in bodies.values()])
    found = slender(points, bodies, 2.0)
    np.testing.assert_array_equal(found, np.arange(len(points)) >= len(thick.vertices))


def test_muscle_regions_follow_distance():
    ball = sphere(5.0, 3)
    muscles = {"a": ball, "b": ball.moved(ball.vertices + [10.5, 0, 0])}
    attached = np.array([[-5.0, 0, 0]])
    regions = muscle_regions(ball.vertices, muscles, attached, 2.0, 0.9)
    to_other = np.linalg.norm(ball.vertices - [10.5, 0, 0], axis=1) - 5.0
    near = np.linalg.norm(ball.vertices - attached[0], axis=1) < 2.0
    np.testing.assert_array_equal(regions == Region.fixed, near)
    assert (regions[to_other < 0.8] == Region.contact).all()
    assert (regions[(to_other > 1.0) & ~near] == Region.sliding).all()


def test_a_wrap_encloses_the_joint_and_touches_the_bones():
    bones = _capsules()
    surface = bone_wrap(bones, [("left", "right")], 1.5)
    assert surface.is_closed() and len(surface.components()) == 1
    assert Distance(surface).signed(np.zeros((1, 3)))[0][0] < 0  # the joint's space
    probe = np.array([[5.0, 0, 0], [-5.0, 0, 0]])
    assert Distance(surface).signed(probe)[0].max() < -2.0
    apart = {"a": sphere(3.0, 3), "b": sphere(4.0, 3).moved(sphere(4.0, 3).vertices + [20.0, 0, 0])}
    alone = wrap(list(apart.values()), 1.0)
    assert alone.volume() == pytest.approx(4 / 3 * np.pi * 64, rel=0.07)


def test_painted_regions_are_read_and_checked(tmp_path):
    path = tmp_path / "regions.json"
    path.write_text('["fixed", "sliding", "contact"]')
    np.testing.assert_array_equal(read_regions(path, 3), [Region.fixed, Region.sliding, Region.contact])
    with pytest.raises(InputError, match="3 values for 4"):
        read_regions(path, 4)
    path.write_text('["glued"]')
    with pytest.raises(InputError, match="glued"):
        read_regions(path, 1)


def test_a_fascia_survives_its_artifact(tmp_path):
    fascia = _fascia()
    fascia.save(tmp_path / "fascia.h5", [])
    again = Fascia.load(tmp_path / "fascia.h5")
    for name in ("regions", "owners", "tied"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fascia, name))
    np.testing.assert_array_equal(again.surface.vertices, fascia.surface.vertices)
    assert (again.name, again.bodies, again.settings) == (fascia.name, fascia.bodies, fascia.settings)
    shape, posed = _solved(0.0)
    x = again.solve(_capsules(), posed, again.surface.vertices)
    y = fascia.solve(_capsules(), posed, fascia.surface.vertices)
    np.testing.assert_array_equal(x, y)
    assert isinstance(shape, Shape)
