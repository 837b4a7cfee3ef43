"""Bones as the first layer."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.mesh.shapes import sphere

from handpipe.core.layers import Frame, Region
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.bones.bone_files import read_surfaces, write_surfaces
from handpipe.skeleton.posing.layer import BoneLayer, bone_regions

BALL = sphere(5.0, 3)
BONES = {"near": BALL, "far": BALL.moved(BALL.vertices + [12.0, 0, 0])}


def test_bones_move_rigidly_and_keep_their_neutral_shape():
    motion = RigidTransform(Rotation.from_rotvec([0.1, 0.7, -0.2]).as_matrix(), np.array([1.0, 2.0, 3.0]))
    frame = Frame("bent", {}, {"near": RigidTransform.identity(), "far": motion})
    shapes = BoneLayer(BONES).solve(frame, {})
    np.testing.assert_array_equal(shapes["near"].vertices, BONES["near"].vertices)
    np.testing.assert_allclose(shapes["far"].vertices, motion(BONES["far"].vertices))
    np.testing.assert_array_equal(shapes["far"].rest, BONES["far"].vertices)
    assert set(np.unique(shapes["near"].fields["region"])) == {Region.fixed, Region.contact}


@pytest.mark.parametrize("radius", [3.0, 6.0])
def test_a_bone_holds_tissue_away_from_other_bones_only(radius):
    points = BALL.vertices
    regions = bone_regions(points, BONES, radius, 0.01)
    to_other = np.linalg.norm(points - [12.0, 0, 0], axis=1) - 5.0
    clear = np.abs(to_other - radius) > 0.1  # facets of the sphere lie beneath it
    np.testing.assert_array_equal(regions[clear] == Region.fixed, to_other[clear] > radius)


def test_points_off_the_bones_are_not_held():
    assert (bone_regions(1.1 * BALL.vertices, BONES, 3.0, 0.01) == Region.contact).all()
    assert (bone_regions(BALL.vertices, {"near": BALL}, 3.0, 0.01) == Region.fixed).all()


def test_bone_surfaces_survive_their_artifact(tmp_path):
    inner = Surface(0.8 * BALL.vertices, BALL.triangles)
    surfaces = {"near": {"marrow": inner, "whole": BALL}}
    write_surfaces(tmp_path / "surfaces.h5", surfaces, [])
    for part, expected in surfaces["near"].items():
        found = read_surfaces(tmp_path / "surfaces.h5", part)["near"]
        np.testing.assert_array_equal(found.vertices, expected.vertices)
        np.testing.assert_array_equal(found.triangles, expected.triangles)
