"""The truth's file is one that the datasets' readers know, and its parts fit together."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe import artifacts
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.truth import toy
from handpipe.truth.body import Body
from handpipe.truth.files import PosedBody, write


@pytest.fixture(scope="module")
def body():
    return Body(toy.finger(6.5), toy.MATERIALS)


def _shape(body, pose):
    """Some shape with bones where the pose has them."""
    return body.prescribed(pose, body.rest + 0.01 * np.sin(body.rest))


def test_surfaces_bound_what_the_field_fills(body):
    pose = toy.hinge(0.2)
    posed = PosedBody.of(body, pose, _shape(body, pose))
    for surface in (posed.skin, *posed.bones.values(), *posed.muscles.values()):
        assert surface.is_closed() and surface.volume() > 0
    x = posed.rest + posed.displacement
    filled = TetMesh(x, posed.tets).volumes().sum()
    hollow = sum(bone.volume() for bone in posed.bones.values())
    assert posed.skin.volume() == pytest.approx(filled + hollow, rel=1e-10)
    muscle = TetMesh(x, posed.tets[posed.labels == 2]).volumes().sum()
    assert posed.muscles["flexor"].volume() == pytest.approx(muscle, rel=1e-10)
    for name, bone in posed.bones.items():
        neutral = PosedBody.of(body, toy.hinge(0.0), body.rest).bones[name]
        assert np.allclose(posed.transforms[name](neutral.vertices), bone.vertices, atol=1e-12)


def test_a_file_says_what_was_written(body, tmp_path):
    pose = toy.hinge(0.2)
    posed = PosedBody.of(body, pose, _shape(body, pose))
    hinge = {"axes": np.array([[0.0, 1.0, 0.0]]), "centre": toy.CENTRE}
    write(tmp_path / "bent.h5", posed, angles={"hinge": 0.2}, joints={"hinge": hinge})
    read = artifacts.read(tmp_path / "bent.h5", "truth")
    skin = Surface(read["skin"]["vertices"], read["skin"]["triangles"])
    assert np.array_equal(skin.vertices, posed.skin.vertices) and skin.is_closed()
    assert set(read["muscles"]) == {"flexor"} and set(read["bones"]) == {"proximal", "distal"}
    assert read["bones"]["distal"]["rotation"][0, 2] == pytest.approx(np.sin(0.2))
    assert np.array_equal(read["field"]["displacement"], posed.displacement)
    assert list(read["field"]["regions"]) == ["skin", "fat", "flexor"]
    assert read["tendons"]["central tendon"]["centreline"].shape[1] == 3
    assert read["angles"]["hinge"] == 0.2


def test_another_frame_moves_everything_alike(body):
    pose = toy.hinge(0.2)
    posed = PosedBody.of(body, pose, _shape(body, pose))
    root = RigidTransform(Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), np.array([3.0, 2.0, -1.0]))
    other = posed.moved(root)
    assert np.allclose(other.rest + other.displacement, root(posed.rest + posed.displacement))
    assert np.allclose(other.skin.vertices, root(posed.skin.vertices))
    neutral = PosedBody.of(body, toy.hinge(0.0), body.rest).bones["distal"].vertices
    assert np.allclose(other.transforms["distal"](neutral), other.bones["distal"].vertices)
