"""The layer of the fat: what it takes from its pose space, and its artifact."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame, Region, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.fem.elements import plasticity
from handpipe.fem.solver.settling import Settled
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.skeleton.posing.local_pose_spaces import LocalPoseSpaces
from handpipe.tissues.fat.layer import FatStrains, TissueLayer
from handpipe.tissues.fat.nails import from_vector
from handpipe.tissues.fat.resting.from_starts import settled_from
from handpipe.tissues.fat.resting.load_case import CONTACTS

from .limb import below, limb

REST = {"root": RigidTransform.identity(), "core": RigidTransform.identity()}


def _bent(angle):
    turn = RigidTransform(Rotation.from_rotvec([0, angle, 0]).as_matrix(), np.zeros(3))
    return {"root": RigidTransform.identity(), "core": turn}


def _strains(tissue):
    poses = {"neutral": REST, "bent": _bent(0.5)}
    spaces = LocalPoseSpaces.build(("root", "core"), {"core": "root"}, poses)
    logs = np.zeros((2, len(tissue.mesh.tets), 6))
    logs[1, :, 0] = 0.1
    shifts = np.zeros((2, *tissue.mesh.vertices.shape))
    shifts[1] = [0.0, 0.3, 0.0]
    return FatStrains(spaces, logs, {"tip": np.stack([np.zeros(6), [0.1, 0, 0, 0, 0, 0.4]])}, shifts)


def test_strains_and_nails_are_those_of_the_examples():
    tissue = limb(Region.fixed)
    layer = TissueLayer("fat", tissue, _strains(tissue))
    np.testing.assert_allclose(layer.plastic_strains(REST), plasticity.identity(len(tissue.mesh.tets)))
    bent = _bent(0.5)
    np.testing.assert_allclose(layer.plastic_strains(bent)[:, 0], np.exp(0.1))
    centre = tissue.skin.vertices[tissue.rigid["tip"].vertices].mean(axis=0)
    expected = bent["core"] @ from_vector(np.array([0.1, 0, 0, 0, 0, 0.4]), centre)
    np.testing.assert_allclose(layer.rigid(bent)["tip"](centre), expected(centre))
    half = layer.plastic_strains(_bent(0.25))[:, 0]
    np.testing.assert_allclose(half, np.exp(0.05), rtol=1e-6)


def test_a_pose_far_from_the_examples_is_warned_of(caplog):
    tissue = limb(Region.fixed)
    poses = {"neutral": REST, "little": _bent(0.3), "more": _bent(0.6)}
    spaces = LocalPoseSpaces.build(("root", "core"), {"core": "root"}, poses, "rbf")
    strains = FatStrains(spaces, np.zeros((3, len(tissue.mesh.tets), 6)), {})
    layer = TissueLayer("fat", tissue, strains)
    for angle, warned in ((0.45, False), (2.0, True)):
        caplog.clear()
        bones = _bent(angle)
        layer._warn_beyond(Frame("fist", {}, bones))
        assert ("fat of fist: no example is near around root, core" in caplog.text) == warned


def test_an_example_starts_from_where_its_strains_were_found():
    tissue, bent = limb(Region.fixed), _bent(0.5)
    rng = np.random.default_rng(0)
    found = bent["core"](tissue.mesh.vertices) + rng.normal(0.0, 1.0, tissue.mesh.vertices.shape)
    strains = _strains(tissue)
    shifts = np.stack([np.zeros_like(found), tissue.shifts(bent, found)])
    layer = TissueLayer("fat", tissue, replace(strains, shifts=shifts))
    np.testing.assert_allclose(layer.starts(bent)[0], found, atol=1e-12)
    np.testing.assert_allclose(layer.starts(REST)[0], tissue.mesh.vertices, atol=1e-12)
    halfway = 0.5 * bent["core"].inverse()(found) + 0.5 * tissue.mesh.vertices
    np.testing.assert_allclose(layer.starts(_bent(0.25))[0], _bent(0.25)["core"](halfway), atol=1e-6)


def test_an_example_is_at_rest_where_its_strains_were_found():
    tissue, bent = limb(Region.fixed), _bent(0.5)
    strains = replace(_strains(tissue), nails={})
    posed = below(bent["core"](below()["bones"]["core"].rest))
    plain = TissueLayer("fat", tissue, strains)
    found = settled_from(plain.load_case(bent, posed), plain.starts(bent)[0])
    renewals = []
    for shift in (np.zeros_like(found.x), tissue.shifts(bent, found.x)):
        strains = replace(strains, shifts=np.stack([np.zeros_like(shift), shift]))
        layer = TissueLayer("fat", tissue, strains)
        shapes = layer.solve(Frame("bent", {}, bent), posed)
        renewals.append(shapes["skin"].figures["contact_renewals"])
    np.testing.assert_allclose(shapes["fat_mesh"].vertices, found.x, atol=1e-3)
    assert renewals[1] == 1 < renewals[0]


def test_without_strains_only_the_nails_are_corrected():
    tissue = limb(Region.fixed)
    plain = TissueLayer("fat", tissue, _strains(tissue).without_strains())
    np.testing.assert_allclose(plain.plastic_strains(_bent(0.5)), plasticity.identity(len(tissue.mesh.tets)))
    assert plain.rigid(_bent(0.5))["tip"].translation != pytest.approx(_bent(0.5)["core"].translation)
    [start] = plain.starts(_bent(0.5))
    np.testing.assert_allclose(start, _bent(0.5)["core"](tissue.mesh.vertices), atol=1e-12)
    bare = TissueLayer("skin", tissue)
    assert bare.plastic_strains(REST) is None


def test_a_bent_frame_gives_skin_and_mesh():
    tissue = limb(Region.fixed)
    layer = TissueLayer("fat", tissue, _strains(tissue).without_strains())
    bent = _bent(0.5)
    bare = TissueLayer("fat", tissue)
    shapes = bare.solve(Frame("bent", {}, bent), below(bent["core"](below()["bones"]["core"].rest)))
    assert set(shapes) == {"skin", "fat_mesh"}
    assert shapes["skin"].figures["contact_unsettled"] == 0
    assert shapes["skin"].figures["contact_motion"] < CONTACTS.settled
    assert shapes["skin"].figures["skin_overlap"] == 0
    np.testing.assert_allclose(shapes["skin"].vertices, bent["core"](tissue.skin.vertices), atol=1e-5)
    corrected = layer.solve(Frame("bent", {}, bent), below(bent["core"](below()["bones"]["core"].rest)))
    tip = tissue.rigid["tip"].vertices
    np.testing.assert_array_equal(np.flatnonzero(corrected["skin"].fields["nail"]), np.unique(tip))
    wanted = layer.rigid(bent)["tip"](tissue.skin.vertices[tip])
    assert np.linalg.norm(corrected["skin"].vertices[tip] - wanted, axis=1).mean() < 0.05


def test_the_depth_of_the_tissue_in_a_body_is_told():
    tissue = limb(Region.fixed)
    shifted = tissue.mesh.vertices + [0.0, 0.7, 0.0]
    assert tissue.inner_overlap(below(), tissue.mesh.vertices) == pytest.approx(0.0, abs=1e-9)
    assert tissue.inner_overlap(below(), shifted) == pytest.approx(0.7, abs=0.06)  # what facets of 1 mm lose


def _hinged(degrees):
    """The bone's vertices with its distal half turned, and the tissue's moved alike."""
    turn = Rotation.from_rotvec([0, np.radians(degrees), 0]).as_matrix()
    core, mesh = below()["bones"]["core"].rest, limb(Region.fixed).mesh
    return (np.where(x[:, :1] > 0, x @ turn.T, x) for x in (core, mesh.vertices))


def test_a_bone_that_cuts_through_itself_inverts_no_tet(monkeypatch):
    tissue, (core, start) = limb(Region.fixed), _hinged(90.0)
    layer = TissueLayer("fat", tissue).lenient()  # the skin over such a bone cannot be out of itself
    monkeypatch.setattr(TissueLayer, "starts", lambda self, bones: [start])
    shapes = layer.solve(Frame("hinged", {}, REST), below(core))
    mesh = shapes["fat_mesh"]
    assert TetMesh(mesh.vertices, mesh.cells).volumes().min() > 0
    told = mesh.figures
    assert told["inverted_tets"] == 0 < told["least_det"] < 0.1
    assert told["unsettled"] == shapes["skin"].figures["contact_unsettled"]
    assert told["contact_motion"] == shapes["skin"].figures["contact_motion"]
    assert {"residual", "tangles"} <= set(told)


def test_an_inverted_tet_is_not_handed_on(monkeypatch):
    core, inverted = _hinged(80.0)
    layer = TissueLayer("fat", limb(Region.fixed))
    monkeypatch.setattr(TissueLayer, "at_rest", lambda *arguments: Settled(inverted, 1, 0.0))
    with pytest.raises(ConvergenceError, match=r"fat of hinged .* tets are inverted, .* mm from core"):
        layer.solve(Frame("hinged", {}, REST), below(core))


def test_after_another_frame_it_starts_from_there(monkeypatch):
    """A limb that is turned as a whole takes its tissue along. Its own starts remain as others."""
    layer, bent = TissueLayer("fat", limb(Region.fixed)), _bent(0.4)
    mesh = layer.tissue.mesh
    x = mesh.vertices + np.random.default_rng(0).normal(0.0, 0.2, mesh.vertices.shape)
    before = Frame("before", {}, REST), {"fat": {"fat_mesh": Shape(mesh.vertices, x, mesh.tets)}}
    asked = []

    def at_rest(self, frame, below, starts, origin):
        asked.extend(starts)
        return Settled(starts[0], 1, 0.0)

    turned = dict.fromkeys(REST, bent["core"])
    monkeypatch.setattr(TissueLayer, "at_rest", at_rest)
    posed = below(bent["core"](below()["bones"]["core"].rest))
    found = layer.solve_after(before, Frame("turned", {}, turned), posed)["fat_mesh"]
    np.testing.assert_allclose(found.vertices, bent["core"](x), atol=1e-9)
    assert [
        len(asked),
        *(np.abs(a - b).max() for a, b in zip(asked[1:], layer.starts(turned), strict=True)),
    ] == [2, 0]


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_viscous_tissue_comes_to_rest_over_the_frames_of_a_pose_that_is_held(ratio):
    """From a tissue that strains drew aside: what is left of their shift falls by r / (1 + r) a frame.

    The springs that hold it are not viscous; in the first frame they take more.
    """
    tissue, frame = limb(Region.fixed), Frame("held", {}, REST)
    drawn = np.tile([1.02, 0.0, 0.0, 1.0, 0.0, 1.0], (len(tissue.mesh.tets), 1))
    resting = TissueLayer("fat", tissue)
    settled = resting.solve(frame, below())
    x = settled_from(resting.load_case(REST, below()).with_strains(drawn), tissue.mesh.vertices).x
    layer, left = resting.viscous(ratio), []
    for _ in range(4):
        mesh = Shape(tissue.mesh.vertices, x, tissue.mesh.tets)
        left.append(np.linalg.norm(x - settled["fat_mesh"].vertices))
        shapes = layer.solve_after((frame, {**below(), "fat": {"fat_mesh": mesh}}), frame, below())
        x = shapes["fat_mesh"].vertices
    np.testing.assert_allclose(np.divide(left[2:], left[1:-1]), ratio / (1 + ratio), rtol=0.04)
    alone = layer.solve(frame, below())["fat_mesh"].vertices  # without a frame before there is no step
    np.testing.assert_array_equal(alone, settled["fat_mesh"].vertices)


@pytest.mark.parametrize("bare", [{}, {"nails": {}}, {"shifts": None}])
def test_strains_survive_their_artifact(tmp_path, bare):
    strains = replace(_strains(limb(Region.fixed)), **bare)
    strains.save(tmp_path / "strains.h5", [])
    again = FatStrains.load(tmp_path / "strains.h5")
    np.testing.assert_array_equal(again.log_strains, strains.log_strains)
    np.testing.assert_array_equal(again.shifts, strains.shifts)
    assert set(again.nails) == set(strains.nails)
    for name in strains.nails:
        np.testing.assert_array_equal(again.nails[name], strains.nails[name])
    for bone, space in strains.spaces.spaces.items():
        assert again.spaces.spaces[bone].poses == space.poses
        weights = again.spaces.spaces[bone].weights(_bent(0.2))
        np.testing.assert_array_equal(weights, space.weights(_bent(0.2)))
