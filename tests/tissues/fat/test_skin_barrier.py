"""Two soft prongs pressed together: planes let the skin into itself, a barrier does not."""

from functools import cache

import numpy as np
import pytest
from scipy import sparse

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame
from handpipe.core.rigid import RigidTransform
from handpipe.fem.contact.one_sided import penalty
from handpipe.fem.elements.validity import Validity
from handpipe.mesh.contact.crossing_triangles import crossings
from handpipe.mesh.contact.self_contacts import self_contact
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.resting.from_starts import settled_from
from handpipe.tissues.fat.resting.load_case import LoadCase
from handpipe.tissues.fat.resting.pressures import pressures_at
from handpipe.tissues.fat.resting.skin_barrier import kept_apart, penetration
from handpipe.tissues.fat.resting.skin_pushes import _places, crossing_vertices, pushes
from handpipe.tissues.fat.skin_contact import DISTANCE

from .test_skin_on_skin import BASE, below, start, tissue, together


def _case(distance):
    return LoadCase(tissue(), below(together(distance)), BASE, tissue().elastic)


@cache
def _planes(distance):
    """The equilibrium with contact planes alone."""
    return settled_from(LoadCase.of(tissue(), below(together(distance)), BASE), start(together(distance)))


@cache
def _barred(distance):
    return kept_apart(_case(distance), _planes(distance))


def _bones(distance):
    return {"palm": RigidTransform.identity(), **together(distance)}


def test_pressed_prongs_do_not_penetrate_and_meet_half_way():
    before, found = penetration(tissue(), _planes(2.8).x), _barred(2.8)
    assert before["skin_crossings"] > 20 and before["skin_inside"] > 10 and before["skin_gap"] == 0
    skin = _case(2.8).skin(found.x)
    figures = penetration(tissue(), found.x)
    assert found.rests and figures["skin_crossings"] == figures["skin_inside"] == 0
    assert 0 < figures["skin_gap"] < DISTANCE
    touching = self_contact(skin, tissue().skin, near=2 * DISTANCE, deep=6.0)
    middle = skin.vertices[touching.vertices, 1]
    assert len(middle) > 40 and touching.gaps.min() > 0
    assert abs(middle.mean()) < 0.05 and np.abs(middle).max() < 0.3
    assert Validity.check(tissue().mesh.vertices, tissue().mesh.tets, found.x).inverted == 0


def test_the_barrier_presses_with_what_the_tissue_resists():
    """The barrier's energy has its gradient, its forces sum to zero, and they balance all others."""
    x, case = _barred(2.8).x, _case(2.8)
    barrier = tissue().skin_barrier()
    force, rng = barrier.gradient(x), np.random.default_rng(0)
    assert np.linalg.norm(force, axis=1).max() > 1.0
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-9 * np.abs(force).sum())
    along = rng.normal(size=x.shape)
    slope = (barrier.value(x + 1e-7 * along) - barrier.value(x - 1e-7 * along)) / 2e-7
    assert slope == pytest.approx(np.vdot(force, along), rel=1e-4)
    others = [case.elastic, *case.constraints(x, contact=[])]
    left = np.linalg.norm(sum(p.gradient(x) for p in others) + force, axis=1)
    assert left.max() < 0.02 * np.linalg.norm(force, axis=1).max()


def test_pressures_of_the_skin_are_those_of_the_barrier():
    x = _barred(2.8).x
    skin = _case(2.8).skin(x)
    pressure = pressures_at(LoadCase.of(tissue(), below(together(2.8)), BASE), x)[""]["skin"]
    touched = pressure > 0
    assert touched.sum() > 20 and np.abs(skin.vertices[touched, 1]).max() < 0.5
    one_side = touched & (tissue().skin.vertices[:, 1] > 0)
    force = tissue().skin_barrier().surface_forces(x)
    assert force[one_side].sum(axis=0)[1] > 0.5 * np.linalg.norm(force[one_side], axis=1).sum() > 0


def test_prongs_apart_keep_their_equilibrium_to_the_last_bit():
    assert _barred(1.5) is _planes(1.5)
    assert penetration(tissue(), _planes(1.5).x)["skin_gap"] == DISTANCE


def test_a_frame_does_not_depend_on_those_before():
    again = kept_apart(_case(2.8), _planes(2.8))
    np.testing.assert_array_equal(again.x, _barred(2.8).x)


def test_a_start_deep_in_itself_is_pushed_apart():
    """Blended prongs lie 1.6 mm in one another, without any equilibrium before."""
    settled = type(_planes(2.8))(start(together(2.8)), 0, 0.0)
    assert len(crossing_vertices(_case(2.8).skin(settled.x))) > 50
    found = kept_apart(_case(2.8), settled)
    away = np.linalg.norm(tissue().skin_matrix @ (found.x - _barred(2.8).x), axis=1)
    assert penetration(tissue(), found.x)["skin_crossings"] == 0 and away.mean() < 0.05


def test_an_edge_that_crosses_a_triangle_is_pushed_out_of_it():
    """A triangle's tip reaches 0.3 mm through another: the push ends where it is 0.2 mm in front of it."""
    vertices = np.array(
        [[-2, -2, 0], [4, -2, 0], [-2, 4, 0], [-0.5, 0, 2], [0.5, 0, 2], [0, 0.1, -0.3]], dtype=float
    )
    skin = Surface(vertices, np.array([[0, 1, 2], [3, 4, 5]]))
    pairs = crossings(skin)
    edges, triangles = skin.edges()[pairs[:, 0]], skin.triangles[pairs[:, 1]]
    places, matrix = _places(skin, edges, triangles)
    np.testing.assert_allclose(matrix @ vertices, places)
    assert len(places) == 2 and places[:, 2] == pytest.approx(0.0, abs=1e-12)
    ones = np.ones(len(vertices))
    [push] = pushes(skin, skin, sparse.identity(len(vertices), format="csr"), ones, 0.2 * ones)
    assert push.value(vertices) == pytest.approx(2 * penalty(np.array([0.2]), push.onset)[0][0])
    away = push.gradient(vertices)
    assert away[5, 2] < 0 < away[:3, 2].sum()  # energy falls as the tip rises and the triangle sinks
    np.testing.assert_allclose(away.sum(axis=0), 0.0, atol=1e-12)
    assert push.value(vertices + np.array([0, 0, 0.3]) * (np.arange(6) > 2)[:, None]) < 1e-12


def test_without_room_a_strict_layer_fails_and_a_lenient_one_tells(caplog):
    """The bones themselves pass through one another."""
    frame = Frame("crossed", {}, _bones(5.6))
    strict = TissueLayer("fat", tissue())
    with pytest.raises(ConvergenceError, match=r"fat of crossed .*around \(.*\) mm, near .*bend less"):
        strict.solve(frame, below(together(5.6)))
    shapes = strict.lenient().solve(frame, below(together(5.6)))
    figures = shapes["skin"].figures
    assert figures["skin_crossings"] > 0 and figures["skin_gap"] == 0
    assert "crossings of the skin with itself" in caplog.text
