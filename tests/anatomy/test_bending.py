"""A limb that bends: the joint that its bones propose, and the equilibrium of its tissues."""

from collections.abc import Mapping

import numpy as np
import pytest
from tests.anatomy.arm import capsule
from tests.anatomy.two_bones import elbow

from handpipe.anatomy.bending import bent_tissue
from handpipe.anatomy.bending.bent_tissue import Bend, BentLimb, Step, follow_bend
from handpipe.anatomy.bending.proposed_joints import propose_joints
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.tissue_mesh import TissueMesh
from handpipe.core import ConvergenceError, InputError, RigidTransform
from handpipe.fem.elements.materials import Material
from handpipe.fem.minimisation.record import Options
from handpipe.mesh.surfaces.surface import Surface

X = np.array([1.0, 0, 0])
Y = np.array([0, 1.0, 0])
SKIN, BONES = elbow(6.0)
SOFT, STIFF = Material(1.0, 0.48), Material(6.0, 0.48)


@pytest.fixture(scope="module")
def tissue() -> TissueMesh:
    """Tets on one side are a muscle whose fibres run along x."""
    domain = Domain.between(SKIN, BONES, 6.0)
    middles = domain.mesh.vertices[domain.mesh.tets].mean(axis=1)
    labels = ((middles[:, 2] < -6) & (np.abs(middles[:, 0]) < 30)).astype(int)
    fibres = labels[:, None] * X
    return TissueMesh(domain.mesh, labels, ("fat", "flexor"), fibres, {}, {}, domain.skin, domain.bones)


def bent(
    tissue: TissueMesh,
    degrees: float,
    shortening: float = 0.0,
    materials: Mapping[str, Material] | None = None,
    steps: list[Step] | None = None,
) -> BentLimb:
    """The toy bent about y through the middle of its gap."""
    contracted = {"flexor": shortening} if shortening else {}
    bend = Bend(("radius",), np.zeros(3), Y, np.radians(degrees), contracted)
    known = materials or {"fat": SOFT, "flexor": STIFF}
    told = steps.append if steps is not None else lambda step: None
    return follow_bend(tissue, BONES, [("humerus", "radius")], known, bend, told)


def test_the_joint_lies_between_the_bones_and_bends_to_the_back() -> None:
    bones = BONES | {"hand": BONES["radius"].moved(BONES["radius"].vertices + [42.0, 0, 0])}
    joints = propose_joints(bones, X)
    assert set(joints) == {"radius", "hand"}
    assert (joints["radius"].parent, joints["radius"].moving) == ("humerus", ("radius", "hand"))
    assert (joints["hand"].parent, joints["hand"].moving) == ("radius", ("hand",))
    axes = joints["radius"].axes
    np.testing.assert_allclose(
        [axes["bend"], axes["sideways"], axes["twist"]], np.eye(3)[[1, 2, 0]], atol=0.05
    )
    down = Bend(("radius",), joints["radius"].centre, axes["bend"], np.radians(40)).motion()
    assert down(np.array([[40.0, 0, 0]]))[0, 2] < -15


def test_the_centre_is_that_of_a_round_end() -> None:
    """About the middle of a ball the gap to it does not change; about the middle of the gap it does."""
    joint = propose_joints(BONES, X)["radius"]
    along = joint.centre[0]
    assert min(abs(along - 7.0), abs(along + 7.0)) < 2.0 and np.abs(joint.centre[1:]).max() < 0.5


def test_a_single_bone_has_no_joint() -> None:
    assert propose_joints({"radius": BONES["radius"]}, X) == {}


def test_bones_that_point_to_the_front_have_axes() -> None:
    turned = {n: Surface(b.vertices[:, [1, 2, 0]], b.triangles) for n, b in BONES.items()}
    axes = propose_joints(turned, np.array([0, 0, 1.0]))["radius"].axes
    frame = np.array(list(axes.values()))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert axes["twist"][2] > 0.99


def test_bones_move_rigidly_and_carry_the_mesh(tissue: TissueMesh) -> None:
    found = bent(tissue, 35.0)
    motion = found.bones["radius"]
    angle = np.degrees(np.linalg.norm(motion.rotation_vector()))
    assert angle == pytest.approx(35.0, abs=1e-9)
    for bone, moved in found.bones.items():
        on = tissue.bones[bone]
        rest = tissue.mesh.vertices[on]
        carried = np.linalg.norm(found.mesh.vertices[on] - moved(rest), axis=1) < 1e-9
        assert carried[np.abs(rest[:, 0]) > 14].all()  # away from the joint all are attached
        assert 0 < (~carried).sum() < 0.3 * len(on)  # in the joint some glide
    assert found.bones["humerus"].angle_to(RigidTransform.identity()) == 0.0


def test_no_bend_is_the_rest_shape(tissue: TissueMesh) -> None:
    steps: list[Step] = []
    found = bent(tissue, 0.0, steps=steps)
    np.testing.assert_allclose(found.mesh.vertices, tissue.mesh.vertices, atol=1e-9)
    assert [(s.number, s.steps, s.angle) for s in steps] == [(1, 1, 0.0)] and found.notes == ()


def test_small_bends_are_linear_and_odd(tissue: TissueMesh) -> None:
    rest = tissue.mesh.vertices
    once, twice, back = (bent(tissue, a).mesh.vertices - rest for a in (0.2, 0.4, -0.2))
    size = np.abs(once).max()
    assert size > 0.1
    assert np.abs(twice - 2 * once).max() < 0.02 * size
    assert np.abs(back + once).max() < 0.02 * size


def test_nearly_incompressible_tissue_keeps_its_volume(tissue: TissueMesh) -> None:
    """The law resists a change of volume the more, the nearer Poisson's ratio is to a half."""

    def change(found: BentLimb) -> float:
        return abs(float(found.mesh.volumes().sum() / tissue.mesh.volumes().sum()) - 1)

    steps: list[Step] = []
    found = bent(tissue, 40.0, steps=steps)
    loose = bent(tissue, 40.0, materials={"fat": Material(1.0, 0.2), "flexor": Material(6.0, 0.2)})
    assert found.mesh.volumes().min() > 0
    assert change(found) < 0.01 < change(loose)
    assert [s.number for s in steps] == [1, 2, 3, 4]
    np.testing.assert_allclose([np.degrees(s.angle) for s in steps], [10, 20, 30, 40])


def test_a_muscle_contracts_along_its_fibres(tissue: TissueMesh) -> None:
    found = bent(tissue, 0.0, 0.3)
    own = tissue.labels == 1
    corners = (mesh.vertices[mesh.tets[own]] for mesh in (tissue.mesh, found.mesh))
    rest, now = ((c[:, 1:] - c[:, :1]).transpose(0, 2, 1) for c in corners)
    gradients = now @ np.linalg.inv(rest)
    weights = tissue.mesh.volumes()[own]
    along = np.average(np.linalg.norm(gradients @ X, axis=1), weights=weights)
    assert 0.7 < along < 0.97  # between bones that stay it cannot shorten freely
    volume = np.average(np.linalg.det(gradients), weights=weights)
    assert volume == pytest.approx(1, abs=0.01)


def test_what_overlaps_is_said(tissue: TissueMesh) -> None:
    bend = Bend(("radius",), np.array([20.0, 0, 0]), Y, np.radians(20.0))
    materials = {"fat": SOFT, "flexor": STIFF}
    near = follow_bend(tissue, BONES, [("humerus", "radius")], materials, bend)
    assert not [n for n in near.notes if n.startswith("humerus and radius")]
    pushed = BONES | {"humerus": capsule(-35.0, 0.0, 5.0, 3.0)}
    far = follow_bend(tissue, pushed, [("humerus", "radius")], materials, bend)
    assert [n for n in far.notes if n.startswith("humerus and radius overlap by")]


def test_a_solve_without_an_equilibrium_is_an_error(
    tissue: TissueMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    def brief(*numbers: float, **given: object) -> Options:
        return Options(*numbers, **given, max_iterations=0)  # type: ignore[arg-type]

    monkeypatch.setattr(bent_tissue, "Options", brief)
    with pytest.raises(
        ConvergenceError, match=r"the pose did not converge: between 0 and 10 degrees.*Bend less"
    ):
        bent(tissue, 20.0)


def test_a_tissue_without_a_material_is_named(tissue: TissueMesh) -> None:
    with pytest.raises(InputError, match="'flexor' is no muscle"):
        bent(tissue, 1.0, materials={"fat": SOFT})
