"""Organs from surfaces: two balls that overlap, one of them with a hole, and what became of them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.anatomy.meshes import box, require_closed_labels, require_conforming
from tests.fem.bodies import sphere

from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.fibres import harmonic_fibres
from handpipe.anatomy.templates.solids import REACH, OrganSolid, depth, ends, template_of
from handpipe.anatomy.templates.tissue_mesh import TissueMesh
from handpipe.anatomy.templates.volume_accounts import accounts
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

RADIUS, APART = 6.0, 7.0
BALL = 4 / 3 * np.pi * RADIUS**3
LENS = np.pi * (4 * RADIUS + APART) * (2 * RADIUS - APART) ** 2 / 12
UPPER, LOWER = np.array([0, 0, APART / 2]), np.array([0, 0, -APART / 2])


def ball(centre: object, radius: float, level: int = 3) -> Surface:
    points, triangles = sphere(radius, level)
    return Surface(points + np.asarray(centre, dtype=float), triangles)


def holed(surface: Surface, towards: object) -> Surface:
    """Without the triangles on one side of it."""
    out = surface.triangle_normals() @ np.asarray(towards, dtype=float)
    return replace(surface, triangles=surface.triangles[out < 0.97])


@pytest.fixture(scope="module")
def bones() -> dict[str, Surface]:
    return {"near": ball([-10, 0, 0], 2.0), "far": ball([10, 0, 0], 2.0)}


@pytest.fixture(scope="module")
def solids() -> dict[str, OrganSolid]:
    upper, lower = ball(UPPER, RADIUS), holed(ball(LOWER, RADIUS), [0, 1, 0])
    assert upper.is_closed() and not lower.is_closed()
    return {n: OrganSolid((s,), ("near",), ("far",)) for n, s in (("upper", upper), ("lower", lower))}


@pytest.fixture(scope="module")
def template(solids: dict[str, OrganSolid], bones: dict[str, Surface]) -> TissueMesh:
    return template_of(solids, Domain.between(ball([0, 0, 0], 16.0), bones, 3.0), bones)


def test_depth_is_the_distance_from_the_surface() -> None:
    surface = ball([1, 2, 3], RADIUS, 4)
    points = np.random.default_rng(1).uniform(-9, 9, (2000, 3)) + [1, 2, 3]
    exact = RADIUS - np.linalg.norm(points - [1, 2, 3], axis=1)
    np.testing.assert_allclose(depth([surface], points), np.maximum(exact, -REACH), atol=0.05)


def test_a_hole_changes_no_side() -> None:
    """Points by the hole itself are left out: there the border is made up."""
    points = np.random.default_rng(2).uniform(-9, 9, (2000, 3))
    away = points[points[:, 1] < RADIUS - 1.5]
    whole, open_one = ball([0, 0, 0], RADIUS), holed(ball([0, 0, 0], RADIUS), [0, 1, 0])
    clear = np.abs(np.linalg.norm(away, axis=1) - RADIUS) > 0.1
    same = (depth([whole], away) > 0) == (depth([open_one], away) > 0)
    assert same[clear].all()


def test_where_two_organs_overlap_the_deeper_one_stays(template: TissueMesh) -> None:
    """By symmetry each keeps half of the lens; the border between them is the plane in the middle."""
    volumes = dict(zip(template.names, template.volumes(), strict=True))
    for name in ("upper", "lower"):
        assert volumes[name] == pytest.approx(BALL - LENS / 2, rel=0.05)
    tets = template.mesh.tets
    shared = np.intersect1d(tets[template.labels == 1], tets[template.labels == 2])
    off = np.abs(template.mesh.vertices[shared, 2])
    assert len(shared) > 30 and off.mean() < 0.25 and off.max() < 1.0


def test_the_mesh_is_sound(template: TissueMesh, bones: dict[str, Surface]) -> None:
    require_conforming(template.mesh, template.mesh.boundary().area())
    require_closed_labels(template.mesh, template.labels)
    metrics = template.metrics()
    assert metrics["manifold"][0] == 1 and metrics["smallest_dihedral"][0] >= 5 and template.warnings == ()
    for name, bone in bones.items():
        on = template.mesh.vertices[template.bones[name]]
        assert Distance(bone).closest(on)[0].max() < 1e-9


def test_fibres_run_from_bone_to_bone(template: TissueMesh) -> None:
    for label in (1, 2):
        own = template.labels == label
        fibres, volumes = template.fibres[own], template.mesh.volumes()[own]
        np.testing.assert_allclose(np.linalg.norm(fibres, axis=1), 1)
        assert np.average(fibres[:, 0], weights=volumes) > 0.8
    assert not template.fibres[template.labels == 0].any()


def test_fibres_of_a_box_are_straight() -> None:
    mesh = box((6, 3, 3), (4.0, 1.0, 1.0))
    origin, insertion = (np.flatnonzero(mesh.vertices[:, 0] == x) for x in (0.0, 4.0))
    along = harmonic_fibres(mesh, origin, insertion)
    np.testing.assert_allclose(along, np.tile([1.0, 0, 0], (len(mesh.tets), 1)), atol=1e-6)


def test_an_origin_on_no_bone_is_the_other_end(bones: dict[str, Surface]) -> None:
    vertices = np.column_stack([np.linspace(-7, 7, 50), np.zeros(50), np.zeros(50)])
    solid = OrganSolid((), (), ("far",))
    origin, insertion = ends(vertices, solid, {name: Distance(bone) for name, bone in bones.items()})
    assert vertices[origin, 0].max() < -3.9 and vertices[insertion, 0].min() > 5.7


def test_accounts_say_where_volume_went(
    solids: dict[str, OrganSolid], bones: dict[str, Surface], template: TissueMesh
) -> None:
    found = accounts(solids, bones, template)
    for account in found.values():
        assert account.source == pytest.approx(BALL, rel=0.03)
        assert account.in_organs == pytest.approx(LENS / 2, rel=0.15)  # balls of flat triangles
        assert account.in_bones == 0 and abs(account.lost()) < 0.05 * BALL
    assert found["upper"].open_edges == 0 < found["lower"].open_edges
    assert found["upper"].branching_edges == found["lower"].branching_edges == 0
    inside = {
        "upper": OrganSolid((ball([0, 0, 0], 6.0),), (), ()),
        "lower": OrganSolid((ball([0, 0, 0], 1.0),), (), ()),
    }
    swallowed = accounts(inside, {"bone": ball([0, 0, 0], 3.0)}, template)
    assert swallowed["upper"].in_bones == pytest.approx(4 / 3 * np.pi * 27, rel=0.03)
    assert swallowed["lower"].in_bones == pytest.approx(swallowed["lower"].source)


def test_surfaces_that_touch_themselves_are_taken_as_they_are(
    bones: dict[str, Surface], template: TissueMesh
) -> None:
    """Two tetrahedra with an edge in common: a source's meshes have such."""
    points = np.array(
        [[-4.0, 0, 0], [4.0, 0, 0], [0, 4.0, 3.0], [0, 4.0, -3.0], [0, -4.0, 3.0], [0, -4.0, -3.0]]
    )
    one, other = ([[0, 1, a], [0, b, 1], [0, a, b], [1, b, a]] for a, b in ((2, 3), (5, 4)))
    surface = Surface(points, np.array(one + other))
    volume = 2 * 8 * 6 * 4 / 6
    pair = {"pair": OrganSolid((surface,), ("near",), ("far",))}
    assert surface.volume() == pytest.approx(volume)
    account = accounts(pair, bones, replace(template, names=("fat", "pair", "lower")))["pair"]
    assert (account.open_edges, account.branching_edges) == (0, 1)
    assert account.source == pytest.approx(volume, rel=0.05)
    found = template_of(pair, Domain.between(ball([0, 0, 0], 16.0), bones, 4.0), bones)
    assert found.volumes()[1] == pytest.approx(volume, rel=0.2)
    require_closed_labels(found.mesh, found.labels)


def test_an_organ_without_a_place_is_named(bones: dict[str, Surface]) -> None:
    solids = {"lost": OrganSolid((ball([0, 0, 40], 2.0),), ("near",), ("far",))}
    with pytest.raises(InputError, match="hand: lost: is nowhere"):
        template_of(solids, Domain.between(ball([0, 0, 0], 16.0), bones, 5.0), bones, source="hand")
