"""Two soft prongs pressed together by their bones: the skin rests on itself half-way between them."""

from functools import cache

import numpy as np
import pytest
from tests.mesh.shapes import fork

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Shape
from handpipe.core.rigid import RigidTransform
from handpipe.fem.solver.settling import Settled
from handpipe.mesh.contact.self_contacts import self_contact
from handpipe.mesh.surfaces.surface import concatenate
from handpipe.tissues.fat.constraints import inner_points
from handpipe.tissues.fat.mesh import tissue_mesh
from handpipe.tissues.fat.resting import from_starts
from handpipe.tissues.fat.resting.from_starts import at_rest, opened, settled_from
from handpipe.tissues.fat.resting.load_case import LoadCase
from handpipe.tissues.fat.skin import Rigid
from handpipe.tissues.fat.tissue import Tissue

from .limb import capsule

RADIUS, APART, CORE = 3.0, 5.0, 1.2
SIDES = {"left": 1.0, "right": -1.0}


def core(side):
    surface = capsule(CORE, 0.8, length=13.0)
    return surface.moved(surface.vertices + [12.5, side * APART, 0])


def below(motions):
    cores = {name: core(side) for name, side in SIDES.items()}
    return {"bones": {n: Shape(s.vertices, motions[n](s.vertices), s.triangles) for n, s in cores.items()}}


def together(distance):
    """Motions of the bones, each by `distance` mm towards the other."""
    return {n: RigidTransform(np.eye(3), np.array([0, -side * distance, 0])) for n, side in SIDES.items()}


@cache
def tissue():
    skin, cores = fork(RADIUS, APART, edge=1.2), concatenate([core(side) for side in SIDES.values()])
    mesh, occupancy = tissue_mesh(skin, cores, 1.8)
    inner = inner_points(below(together(0)), ("bones",), cores, 0.1)
    x, y, _ = mesh.vertices.T
    along = np.clip((x - 2) / 4, 0, 1)
    weights = np.stack([1 - along, along * (y > 0), along * (y <= 0)], axis=1)
    base = Rigid("palm", np.flatnonzero(skin.vertices[:, 0] < -2))
    return Tissue(mesh, occupancy, skin, inner, {"base": base}, ("palm", *SIDES), weights)


BASE = {"base": RigidTransform.identity()}


def start(motions):
    return tissue().pose({"palm": RigidTransform.identity(), **motions})


def pressed(distance):
    motions, body = together(distance), tissue()
    settled = settled_from(LoadCase.of(body, below(motions), BASE), start(motions))
    assert settled.rests
    return body.skin.moved(body.skin_matrix @ settled.x)


def test_prongs_pressed_together_meet_half_way():
    skin = pressed(2.8)  # round prongs would overlap by 1.6 mm
    found = self_contact(skin, tissue().skin, near=0.2, deep=6.0)
    assert len(found.vertices) > 40
    assert found.gaps.min() > -0.16  # a tenth of that: the springs give way
    middle = skin.vertices[found.vertices, 1]
    assert abs(middle.mean()) < 0.05 and np.abs(middle).max() < 0.3
    own_side = np.sign(tissue().skin.vertices[:, 1]) * skin.vertices[:, 1]
    assert own_side[skin.vertices[:, 0] > 9].min() > -0.3  # none went through to the other


def test_prongs_that_do_not_meet_are_left_alone():
    free = pressed(1.5)  # 1 mm apart
    round_again = np.hypot(np.abs(free.vertices[:, 1]) - (APART - 1.5), free.vertices[:, 2])
    shaft = (free.vertices[:, 0] > 9) & (free.vertices[:, 0] < 18)
    assert round_again[shaft] == pytest.approx(RADIUS, abs=0.1)


def test_a_start_with_skin_deep_in_skin_is_opened():
    """Blended prongs lie 1.6 mm in one another; from the opened start they rest where they do from there."""
    motions, body = together(2.8), tissue()
    blended = start(motions)
    assert body.overlap(blended) > 1.2
    case = LoadCase.of(body, below(motions), BASE)
    way = opened(case, blended)
    assert body.overlap(way) < 0.3
    settled = settled_from(case, way)
    there = pressed(2.8).vertices
    away = np.linalg.norm(body.skin_matrix @ settled.x - there, axis=1)
    assert settled.rests and body.overlap(settled.x) < 0.16 and away.mean() < 0.05


def test_a_start_with_its_skin_apart_is_taken_as_it_is():
    motions = together(1.5)
    x = start(motions)
    assert opened(LoadCase.of(tissue(), below(motions), BASE), x) is x


def test_a_size_without_equilibrium_is_passed_over(monkeypatch):
    """The first size fails, as 0.6 does in a fist: from 0.75 on it opens all the same."""
    motions, body, sizes = together(2.8), tissue(), []

    def failing_first(*arguments, solved=from_starts._near):
        sizes.append(arguments)
        if len(sizes) == 1:
            raise ConvergenceError("soft tissue", "no equilibrium")
        return solved(*arguments)

    monkeypatch.setattr(from_starts, "_near", failing_first)
    monkeypatch.setattr(from_starts, "SIZES", (0.6, 0.75, 0.9))
    way = opened(LoadCase.of(body, below(motions), BASE), start(motions))
    assert len(sizes) == 3 and body.overlap(way) < 0.3


def _led_astray(monkeypatch, motions, times):
    """Searches of `settled_from`, of which the first `times` end with the skin 1.6 mm in itself."""
    searches = []

    def led_astray(*arguments, solved=from_starts.settled_from):
        searches.append(arguments)
        return Settled(start(motions), 1, 0.0) if len(searches) <= times else solved(*arguments)

    monkeypatch.setattr(from_starts, "settled_from", led_astray)
    return searches


def test_skin_that_gets_into_skin_on_the_way_is_opened(monkeypatch):
    """The start has its skin apart; a first search that ends with it in itself is not the last."""
    motions, body, apart = together(2.8), tissue(), start(together(1.5))
    assert body.overlap(apart) == 0.0
    searches = _led_astray(monkeypatch, motions, 1)
    settled = at_rest(LoadCase.of(body, below(motions), BASE), [apart])
    assert len(searches) == 2 and settled.rests and body.overlap(settled.x) < 0.16


def test_a_start_that_leads_into_skin_is_followed_by_the_next(monkeypatch):
    """Both searches from the first start end with the skin in itself, as what was fitted to a scan may."""
    motions, body, apart = together(2.8), tissue(), start(together(1.5))
    searches = _led_astray(monkeypatch, motions, 2)
    settled = at_rest(LoadCase.of(body, below(motions), BASE), [apart, start(motions)])
    assert len(searches) == 3 and settled.rests and body.overlap(settled.x) < 0.16


def test_a_further_start_whose_bodies_leave_no_room_is_not_tried(monkeypatch):
    """Cores 2.2 mm apart hold prongs 6 mm thick: the second start lies as deep in itself as the first."""
    motions, body = together(3.9), tissue()
    crowded = start(motions)
    assert body.overlap(crowded) > 3.0
    searches = _led_astray(monkeypatch, motions, 9)
    monkeypatch.setattr(from_starts, "opened", lambda case, x, anyway=False: x)
    one = at_rest(LoadCase.of(body, below(motions), BASE), [start(together(1.5)), crowded, crowded])
    assert len(searches) == 1 + 1 and body.overlap(one.x) > 3.0
    del searches[:]
    at_rest(LoadCase.of(body, below(motions), BASE), [start(together(1.5)), start(together(2.5))])
    assert len(searches) == 2 + 2


def test_without_an_equilibrium_from_any_start_there_is_no_result(monkeypatch):
    def none(*arguments):
        raise ConvergenceError("soft tissue", "none from here")

    monkeypatch.setattr(from_starts, "settled_from", none)
    body = tissue()
    with pytest.raises(ConvergenceError, match="none from here"):
        at_rest(LoadCase.of(body, below(together(2.8)), BASE), [start(together(1.5))])
