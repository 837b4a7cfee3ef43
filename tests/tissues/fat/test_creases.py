"""One soft tissue with creases: its regions, its mesh and its folds on a finger of two bones."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from handpipe.mesh.contact.crossing_triangles import crossings
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.posing.joint_sweep import swept_vertices
from handpipe.skeleton.posing.layer import BoneLayer
from handpipe.stages.tissues.mesh_crease_tissue import CreaseEdges, crease_tissue, swept_bones
from handpipe.tissues.fat.bending import partway
from handpipe.tissues.fat.creases.fold_form import fold_form
from handpipe.tissues.fat.creases.folding import folding_vertices
from handpipe.tissues.fat.creases.layer import CreaseLayer, load_skin
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.tissue import Tissue

from .limb import limb
from .two_bones import BONE, FLESH, GAP, LIMITS, bent, rig, skin

EDGES = CreaseEdges(fine=1.1, coarse=2.2, deep=3.0)


@pytest.fixture(scope="module")
def tissue() -> Tissue:
    return crease_tissue(rig(), skin(), "right", EDGES)


def solved(body: Tissue, degrees: float):
    frame = bent(degrees)
    return CreaseLayer("skin", body).solve(frame, {"bones": BoneLayer(rig().surfaces).solve(frame, {})})


@pytest.fixture(scope="module")
def folded(tissue: Tissue):
    return solved(tissue, 80.0)


def test_skin_folds_on_the_palm_at_the_joint_alone() -> None:
    surface = skin().surface
    folding = folding_vertices(surface, rig())
    assert folding.any()
    x, _, z = surface.vertices[folding].T
    assert z.max() < 0.0
    assert (
        np.abs(x + 2.0).max() < FLESH * np.pi / 4 + 3.0
    )  # half the arc that the bend takes, and the smoothing
    assert folding[np.argmin(np.linalg.norm(surface.vertices - [-2.0, 0, -FLESH], axis=1))]


def test_a_joint_that_cannot_move_folds_nothing_and_sweeps_its_neutral_faces() -> None:
    stiff = replace(rig(), joints=(replace(rig().joints[0], limits=0.01 * LIMITS),))
    assert not folding_vertices(skin().surface, stiff).any()
    few, many = (swept_vertices(tree, np.radians(10.0)) for tree in (stiff, rig()))
    assert few["near"].sum() < many["near"].sum()
    assert not many["far"].any()


def test_swept_faces_are_those_that_a_dense_search_finds() -> None:
    """Swept faces are within reach of the moved child by distances of points alone; the tip is swept."""
    swept = swept_vertices(rig(), np.radians(2.0))["near"]
    near, far = rig().surfaces["near"], rig().surfaces["far"]
    least = np.full(len(near.vertices), np.inf)
    for degrees in np.arange(0.0, 91.0, 2.0):
        points = bent(degrees).bones["far"](far.vertices)
        gaps = np.linalg.norm(near.vertices[:, None] - points[None], axis=2).min(axis=1)
        least = np.minimum(least, gaps)
    assert least[swept].max() < 2.5 + 2 * 1.3  # an edge of either bone more
    tip = near.vertices[:, 0] > -GAP - 0.3  # faces the other bone squarely in neutral
    assert tip.sum() > 3 and swept[tip].all()


def test_tets_fill_what_is_between_the_surfaces_and_their_boundary_is_the_skin(tissue: Tissue) -> None:
    mesh, outer = tissue.mesh, tissue.skin
    np.testing.assert_array_equal(mesh.vertices[: len(outer.vertices)], outer.vertices)
    faces = {tuple(sorted(face)) for face in mesh.boundary().triangles.tolist()}
    assert {tuple(sorted(face)) for face in outer.triangles.tolist()} <= faces
    hole = outer.volume() - mesh.volumes().sum()
    bones = sum(bone.volume() for bone in rig().surfaces.values())
    assert 0.9 * bones < hole < 1.15 * bones  # the joint's space belongs to it
    assert mesh.smallest_dihedral() > 5.0


def test_tets_are_small_and_soft_where_skin_folds(tissue: Tissue) -> None:
    creases = tissue.creases
    assert creases is not None
    values = set(zip(creases.young.tolist(), creases.poisson.tolist(), strict=True))
    assert values == {(12.0, 0.495), (6.0, 0.495), (2.0, 0.45)}
    centres = tissue.mesh.vertices[tissue.mesh.tets].mean(axis=1)
    soft, back = creases.young == 2.0, creases.young == 6.0
    depth = FLESH - np.hypot(centres[soft, 1], centres[soft, 2])
    assert depth.max() < 3.2 and centres[soft, 2].max() < 1.0
    assert (centres[back, 2] > -BONE).all()
    sizes = np.cbrt(tissue.mesh.volumes())
    shallow = FLESH - np.hypot(centres[:, 1], centres[:, 2]) < 1.5
    far = shallow & (np.abs(centres[:, 0] - 18.0) < 5.0)
    assert np.median(sizes[soft & shallow]) < 0.7 * np.median(sizes[far])


def test_tissue_is_in_contact_on_swept_faces_and_fixed_on_shafts() -> None:
    shapes = swept_bones(rig())
    x = shapes["near"].rest[:, 0]
    region = shapes["near"].fields["region"]
    assert (region[x < -10.0] == 2).all()
    assert (region[swept_vertices(rig(), np.radians(5.0))["near"]] == 0).all()


def test_a_bent_finger_folds_without_inverted_tets_or_penetration(tissue: Tissue, folded) -> None:
    skin_shape, mesh_shape = folded["skin"], folded["skin_mesh"]
    corners = mesh_shape.vertices[tissue.mesh.tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert volumes.min() > 0
    assert abs(volumes.sum() / tissue.mesh.volumes().sum() - 1) < 0.05
    surface = tissue.skin.moved(skin_shape.vertices)
    assert len(crossings(surface)) == skin_shape.figures["skin_crossings"] == 0
    # Just beneath each vertex the winding number of a surface that does not cut itself is one.
    beneath = surface.vertices - 1e-3 * surface.vertex_normals()
    inside = trimesh.Trimesh(surface.vertices, surface.triangles, process=False).contains(beneath)
    assert inside.mean() > 0.999


def test_soft_folds_are_deeper_and_sharper_than_those_of_one_material(tissue: Tissue, folded) -> None:
    assert tissue.creases is not None
    same = replace(
        tissue.creases,
        young=np.full_like(tissue.creases.young, 12.0),
        poisson=np.full_like(tissue.creases.poisson, 0.495),
    )
    uniform = solved(replace(tissue, creases=same), 80.0)["skin"]
    soft = folded["skin"].figures
    assert soft["fold_depth"] > 1.2 * uniform.figures["fold_depth"]
    assert soft["fold_angle"] > 1.2 * uniform.figures["fold_angle"]


def test_form_of_a_groove_in_a_plane() -> None:
    """A valley of 60 degrees on either side along y, in a plane that was flat."""
    x, y = np.meshgrid(np.arange(-6.0, 6.5), np.arange(-6.0, 6.5), indexing="ij")
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    ids = np.arange(13 * 13).reshape(13, 13)
    a, b, c, d = (ids[i : 12 + i, j : 12 + j].ravel() for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)))
    rest = Surface(flat, np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)]))
    side, up = np.cos(np.pi / 3) * flat[:, 0], np.sin(np.pi / 3) * np.abs(flat[:, 0])
    bottom = np.flatnonzero((flat[:, 0] == 0) & (np.abs(flat[:, 1]) < 3))
    found = fold_form(rest, rest.moved(np.column_stack([side, flat[:, 1], up])), bottom)
    assert found["fold_angle"] == pytest.approx(120.0)
    disk = flat[np.linalg.norm(flat, axis=1) <= 3.0]
    assert found["fold_depth"] == pytest.approx(np.sin(np.pi / 3) * np.abs(disk[:, 0]).mean())
    assert fold_form(rest, rest, bottom) == {"fold_depth": 0.0, "fold_angle": 0.0}


def test_rigid_motion_of_all_bones_moves_the_tissue_rigidly(tissue: Tissue) -> None:
    """Neutral is an equilibrium: nothing is stressed by the mesh, its contacts or the barrier."""
    found = solved(tissue, 0.0)["skin_mesh"]
    np.testing.assert_allclose(found.vertices, tissue.mesh.vertices, atol=1e-3)


def test_bones_partway_turn_by_a_share_of_each_hinge() -> None:
    whole = bent(80.0).bones
    for share in (0.25, 1.0):
        for origin in (0.0, 30.0):
            found = partway(bent(origin).bones, whole, rig().parents, share)
            expected = bent(origin + (80.0 - origin) * share).bones
            for bone in whole:
                np.testing.assert_allclose(found[bone].matrix, expected[bone].matrix, atol=1e-12)


def test_after_a_frame_near_it_folds_as_from_neutral(tissue: Tissue, folded) -> None:
    frame, before = bent(80.0), bent(74.0)
    layer, bones = CreaseLayer("skin", tissue), BoneLayer(rig().surfaces)
    shapes = {"skin": solved(tissue, 74.0)}
    after = layer.solve_after((before, shapes), frame, {"bones": bones.solve(frame, {})})
    assert after["skin"].figures["fold_depth"] == pytest.approx(
        folded["skin"].figures["fold_depth"], abs=0.05
    )
    apart = np.linalg.norm(after["skin"].vertices - folded["skin"].vertices, axis=1)
    moved = np.linalg.norm(shapes["skin"]["skin"].vertices - folded["skin"].vertices, axis=1)
    assert apart.mean() < 0.01 and apart.max() < 0.1 * moved.max()
    assert len(crossings(Surface(after["skin"].vertices, after["skin"].cells))) == 0


def test_its_file_keeps_the_creases_and_a_plain_tissue_has_none(tissue: Tissue, tmp_path) -> None:
    tissue.save(tmp_path / "creases.h5", [])
    layer = load_skin([tmp_path / "creases.h5"], {})
    assert isinstance(layer, CreaseLayer) and layer.tissue.creases is not None and tissue.creases is not None
    np.testing.assert_array_equal(layer.tissue.creases.young, tissue.creases.young)
    assert layer.tissue.parents == {"far": "near"}
    limb().save(tmp_path / "plain.h5", [])
    plain = load_skin([tmp_path / "plain.h5"], {})
    assert type(plain) is TissueLayer and plain.tissue.creases is None
