"""Tissue meshes and their occupancy against spheres, whose volumes are known."""

import re

import numpy as np
import pytest
import trimesh
from tests.mesh.shapes import box_tets, sphere, two_fingers

from handpipe.core.errors import InputError
from handpipe.mesh.contact import crossings
from handpipe.mesh.generation import genus, union_surface
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface, concatenate
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.tissues.fat.constraints import InnerPoints
from handpipe.tissues.fat.mesh import (
    LEAST_OCCUPANCY,
    inner_surface,
    occupancy,
    skin_share,
    tissue_mesh,
    without_pockets,
)
from handpipe.tissues.fat.skin import closed_skin

OUTER, INNER = 10.0, 5.0


def _volume(radius):
    return 4 / 3 * np.pi * radius**3


def test_a_shell_is_meshed_with_its_own_volume():
    skin, core = remesh(sphere(OUTER), 2.0), remesh(sphere(INNER), 1.5)
    mesh, share = tissue_mesh(skin, core, 3.0)
    assert mesh.volumes().min() > 0
    assert share.min() >= LEAST_OCCUPANCY and share.max() <= 1
    counted = np.where(share > LEAST_OCCUPANCY, share, 0.0)
    assert counted @ mesh.volumes() == pytest.approx(_volume(OUTER) - _volume(INNER), rel=0.04)
    # no tet is left inside the core, and none of the tissue is missing
    corners = np.linalg.norm(mesh.vertices, axis=1)[mesh.tets]
    assert (corners.max(axis=1) > 0.95 * INNER).all()
    probe = np.random.default_rng(0).normal(size=(200, 3))
    probe *= np.linspace(INNER + 0.2, OUTER - 0.2, 200)[:, None] / np.linalg.norm(probe, axis=1)[:, None]
    assert Distance(Surface(mesh.vertices, mesh.boundary_faces()[0])).signed(probe)[0].max() < 0.1


def test_the_skin_of_a_shell_has_its_own_volume():
    """Of tets with edges of 3 mm, for a skin thinner and thicker than they are; none lies at the core."""
    skin, core = remesh(sphere(OUTER), 2.0), remesh(sphere(INNER), 1.5)
    mesh, _ = tissue_mesh(skin, core, 3.0)
    tissue = occupancy(mesh, skin, core) * mesh.volumes()
    for thickness in (1.0, 3.5):
        share = skin_share(mesh, skin, core, thickness)
        assert share.min() == 0 and 0.8 < share.max() <= 1
        assert share @ tissue == pytest.approx(_volume(OUTER) - _volume(OUTER - thickness), rel=0.05)
        assert (share[np.linalg.norm(mesh.vertices[mesh.tets], axis=2).max(axis=1) < 6.0] == 0).all()


def test_fingers_that_lie_close_are_meshed_apart():
    """0.6 mm between two fingers: pushed outwards by a tenth of an edge, their hulls would cross."""
    sizes = {(-4.8, 0, 18): (9, 18, 36), (4.8, 0, 18): (9, 18, 36), (0, 0, -6): (18.6, 18, 14)}
    boxes = [trimesh.creation.box(size).apply_translation(at) for at, size in sizes.items()]
    fine = [remesh(Surface(np.asarray(m.vertices), np.asarray(m.faces)), 2.0) for m in boxes]
    skin = union_surface(fine, 0.3)
    coarse = remesh(skin, 4.0)
    pushed = coarse.moved(coarse.vertices + 0.4 * coarse.vertex_normals())
    assert len(crossings(coarse)) == 0 and len(crossings(pushed)) > 0
    mesh, share = tissue_mesh(skin, sphere(4.0).moved(sphere(4.0).vertices - [0, 0, 6]), 4.0)
    assert (mesh.volumes() > 0).all()
    tissue = float(share @ mesh.volumes())
    assert tissue == pytest.approx(skin.volume() - sphere(4.0).volume(), rel=0.03)


def test_a_skin_that_cuts_itself_is_refused_with_its_place():
    ball = sphere(8.0)
    both = concatenate([ball, ball.moved(ball.vertices + [9.0, 0, 0])])
    with pytest.raises(InputError, match=r"skin: triangles: cuts itself near \(.*edges of 3 mm"):
        tissue_mesh(both, sphere(2.0), 3.0)


def test_occupancy_is_the_share_between_two_spheres():
    unit = box_tets(8)
    mesh = unit.moved(22.0 * (unit.vertices - 0.5))
    share = occupancy(mesh, sphere(OUTER), sphere(INNER))
    weights = np.random.default_rng(1).dirichlet(np.ones(4), size=2000)
    radii = np.linalg.norm(np.einsum("sc,mci->msi", weights, mesh.vertices[mesh.tets]), axis=2)
    exact = ((radii < OUTER) & (radii > INNER)).mean(axis=1)
    assert np.sqrt(((share - exact) ** 2).mean()) < 0.06
    assert share @ mesh.volumes() == pytest.approx(_volume(OUTER) - _volume(INNER), rel=0.02)
    np.testing.assert_array_equal(share[radii.max(axis=1) < INNER - 2.0], 0.0)


def test_a_narrow_cleft_is_closed_and_the_rest_kept():
    ball = sphere(6.0, 4)
    cleft = 1.0
    other = ball.moved(ball.vertices + [12.0 + cleft, 0, 0])
    middle = np.array([[6.0 + cleft / 2, 0, 0]])
    wrapped = inner_surface([ball, other], 0.8, 1.0)
    assert Distance(wrapped).signed(middle)[0][0] < 0
    alone = inner_surface([ball], 0.8, 1.0)
    assert alone.is_closed()
    assert alone.volume() == pytest.approx(_volume(6.0), rel=0.04)
    assert np.abs(np.linalg.norm(alone.vertices, axis=1) - 6.0).max() < 0.15
    far = np.linalg.norm(wrapped.vertices[wrapped.vertices[:, 0] < 0], axis=1)
    assert np.abs(far - 6.0).max() < 0.15


def test_a_wide_cleft_stays_open():
    ball = sphere(6.0, 4)
    other = ball.moved(ball.vertices + [15.5, 0, 0])
    wrapped = inner_surface([ball, other], 0.8, 1.0)
    assert Distance(wrapped).signed(np.array([[7.75, 0.0, 0.0]]))[0][0] > 0


def test_a_scan_with_a_hole_becomes_closed_skin():
    ball = sphere(OUTER, 4)
    covered = (ball.vertices[ball.triangles][:, :, 0] < 9.0).all(axis=1)
    scan = Surface(ball.vertices, ball.triangles[covered]).compact()
    skin, notes = closed_skin(scan, 1.5)
    assert skin.is_closed()
    assert any("hole" in note for note in notes)
    cap = np.pi * 1.0**2 * (3 * OUTER - 1.0) / 3  # at most this is missing: a cap of height 1
    assert _volume(OUTER) - cap - 0.02 * _volume(OUTER) < skin.volume() < 1.01 * _volume(OUTER)


def test_fingers_that_a_scanner_joined_are_parted_with_a_warning(caplog):
    skin, _ = closed_skin(two_fingers(15.0, radius=1.0), 1.0)
    assert genus(skin) == 0 and skin.is_closed()
    assert Distance(two_fingers()).closest(skin.vertices)[0].max() < 0.5
    [said] = caplog.messages
    assert re.search(r"Cut a bridge, [67]\.\d mm around, at \(1[45]\.\d, 4\.\d, -?0\.\d\) mm", said)
    assert "are left" not in said


def test_pockets_that_hang_by_an_edge_or_by_nothing_are_left_out():
    """A box of tets, one more on an edge of it and one apart, with one inner point in each."""
    box = box_tets(4)
    n = len(box.vertices)
    top = np.flatnonzero(np.isclose(box.vertices[:, 2], 1.0) & np.isclose(box.vertices[:, 1], 1.0))[:2]
    hinged = np.mean(box.vertices[top], axis=0) + [[0.0, 0.1, 0.1], [0.0, 0.15, 0.05]]
    apart = np.array([[2.0, 0, 0], [2.1, 0, 0], [2, 0.1, 0], [2, 0, 0.1]])
    tets = np.vstack([box.tets, [[*top, n, n + 1]], [[n + 2, n + 3, n + 4, n + 5]]])
    mesh = TetMesh(np.vstack([box.vertices, hinged, apart]), tets)
    if mesh.volumes()[-2] < 0:
        tets[-2] = tets[-2, [1, 0, 2, 3]]
    rest = np.array([[0.5, 0.5, 0.5], mesh.vertices[tets[-2]].mean(axis=0), apart.mean(axis=0)])
    one = np.ones(3, dtype=np.int64)
    points = InnerPoints(("bones",), ("core",), 0 * one, np.arange(3), rest, rest, one, np.ones(3))
    skin = remesh(sphere(0.3), 0.1)
    skin = skin.moved(skin.vertices + 0.5)
    kept, share, inside = without_pockets(mesh, np.linspace(0.5, 1, len(tets)), skin, points)
    np.testing.assert_array_equal(kept.vertices[kept.tets], box.vertices[box.tets])
    np.testing.assert_array_equal(share, np.linspace(0.5, 1, len(tets))[:-2])
    np.testing.assert_array_equal(inside.rest, rest[:1])
    assert inside.vertex.tolist() == [0] and inside.bodies == ("core",)


@pytest.mark.parametrize(("outside", "refused"), [(0.02, False), (0.2, True)])
def test_a_sliver_beneath_the_skin_is_left_out_where_the_skin_is_close_to_the_rest(outside, refused):
    """A box of tets with edges of about 0.25, and a small tet over it, in which the skin has one vertex."""
    box = box_tets(4)
    sliver = np.array([0.5, 0.5, 1.0 + outside]) + 0.01 * np.array(
        [[-1, -1, -1], [1, -1, -1], [0, 1, -1], [0, 0, 1]]
    )
    n = len(box.vertices)
    mesh = TetMesh(np.vstack([box.vertices, sliver]), np.vstack([box.tets, [[n, n + 1, n + 2, n + 3]]]))
    if mesh.volumes()[-1] < 0:
        mesh.tets[-1] = mesh.tets[-1, [1, 0, 2, 3]]
    one = np.ones(1, dtype=np.int64)
    inner = np.full((1, 3), 0.5)
    points = InnerPoints(("bones",), ("core",), 0 * one, one, inner, inner, one, np.ones(1))
    ball = sphere(0.3, 2)
    places = ball.vertices + 0.5
    places[np.argmax(places[:, 2])] = [0.5, 0.5, 1.0 + outside]
    if refused:
        with pytest.raises(InputError, match="2 pieces that share no face"):
            without_pockets(mesh, np.ones(len(mesh.tets)), ball.moved(places), points)
    else:
        kept = without_pockets(mesh, np.ones(len(mesh.tets)), ball.moved(places), points)[0]
        np.testing.assert_array_equal(kept.vertices[kept.tets], box.vertices[box.tets])


def test_a_skin_on_another_piece_is_refused_with_its_place():
    box = box_tets(2)
    both = TetMesh(
        np.vstack([box.vertices, box.vertices + [3.0, 0, 0]]), np.vstack([box.tets, box.tets + 27])
    )
    one = np.ones(1, dtype=np.int64)
    points = InnerPoints(
        ("bones",), ("core",), 0 * one, one, np.zeros((1, 3)), np.zeros((1, 3)), one, np.ones(1)
    )
    finger = sphere(0.3)
    with pytest.raises(InputError, match="2 pieces that share no face, 50 % of the tissue"):
        without_pockets(both, np.ones(len(both.tets)), finger.moved(finger.vertices + 0.5), points)


def test_a_whole_tissue_is_kept_as_it_is():
    mesh = box_tets(3)
    points, share = object(), np.ones(len(mesh.tets))
    assert without_pockets(mesh, share, sphere(0.3), points) == (mesh, share, points)  # type: ignore[arg-type]
