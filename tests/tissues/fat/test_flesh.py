"""The flesh: one soft tissue on bones, whose skin does not feel itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core.layers import Frame, Region, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.tissues.fat.flesh import FleshLayer
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.resting import LoadCase, settled_from

from .limb import below, limb
from .test_skin_on_skin import APART, RADIUS, tissue, together
from .test_skin_on_skin import below as under_prongs


def test_it_goes_with_the_bone():
    body = limb()
    motion = RigidTransform(Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix(), np.array([3.0, -20.0, 7.0]))
    posed = below(motion(below()["bones"]["core"].rest))
    found = FleshLayer(body).solve(Frame("moved", {}, {"core": motion}), posed)["flesh_mesh"]
    np.testing.assert_allclose(found.vertices, motion(body.mesh.vertices), atol=1e-6)
    np.testing.assert_array_equal(found.rest, body.mesh.vertices)


def test_where_no_skin_touches_it_is_the_soft_tissue_of_the_skin():
    """A bone that moves in a tissue whose tip stays."""
    body = limb()
    frame = Frame("shifted", {}, {"core": RigidTransform.identity()})
    posed = below(below()["bones"]["core"].rest + [0.0, 1.0, 0.0])
    flesh = FleshLayer(body).solve(frame, posed)["flesh_mesh"].vertices
    skin = TissueLayer("skin", body).solve(frame, posed)["skin_mesh"].vertices
    assert np.linalg.norm(skin - body.mesh.vertices, axis=1).max() > 0.9
    np.testing.assert_allclose(flesh, skin, atol=0.02)


def test_its_skin_is_stiff_where_the_soft_tissue_has_none():
    """One mesh serves both: a tissue that is as soft in its skin, and the flesh, 20 times stiffer there."""
    plain = limb()
    share = np.linspace(0.0, 1.0, len(plain.mesh.tets))
    body = replace(plain, skin_share=share, settings=replace(plain.settings, young=6.0, skin_young=6.0))
    x = plain.mesh.vertices * [1.2, 0.95, 1.0]
    energies = plain.mesh.volumes() * plain.occupancy
    uniform = 6.0 * plain.elastic.value(x)
    assert TissueLayer("skin", body).tissue.elastic.value(x) == pytest.approx(uniform)
    stiffer = (energies @ (1.0 + 19.0 * share)) / energies.sum()
    assert FleshLayer(body).tissue.elastic.value(x) == pytest.approx(stiffer * uniform)


def test_after_another_frame_it_comes_to_rest_in_the_same_shape():
    """The frame before is nearer than the blend of the bones: the planes need one renewal less."""
    layer, still = FleshLayer(limb()), {"core": RigidTransform.identity()}
    shifts = [below()["bones"]["core"].rest + [0.0, y, 0.0] for y in (0.95, 1.0)]
    frames = [Frame(name, {}, still) for name in ("before", "shifted")]
    shapes = [{"flesh": layer.solve(f, below(x))} for f, x in zip(frames, shifts, strict=True)]
    alone = shapes[1]["flesh"]["flesh_mesh"]
    after = layer.solve_after((frames[0], shapes[0]), frames[1], below(shifts[1]))["flesh_mesh"]
    np.testing.assert_allclose(after.vertices, alone.vertices, atol=0.01)
    moved = np.linalg.norm(shapes[0]["flesh"]["flesh_mesh"].vertices - alone.vertices, axis=1)
    assert moved.max() > 0.04
    assert after.figures["contact_renewals"] < alone.figures["contact_renewals"]


def test_prongs_pressed_together_stay_round_and_pass_through_each_other():
    motions, body = together(2.8), tissue()
    frame = Frame("pressed", {}, {"palm": RigidTransform.identity(), **motions})
    x = FleshLayer(body).solve(frame, under_prongs(motions))["flesh_mesh"].vertices
    skin = body.skin_matrix @ x
    axis = np.sign(body.skin.vertices[:, 1]) * (APART - 2.8)
    shaft = (skin[:, 0] > 9) & (skin[:, 0] < 18)
    np.testing.assert_allclose(np.hypot(skin[:, 1] - axis, skin[:, 2])[shaft], RADIUS, atol=0.1)
    assert body.overlap(x) > 1.0


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_viscous_flesh_comes_to_rest_over_the_frames_of_a_pose_that_is_held(ratio):
    """From where strains drew it: what is left of their shift falls by r / (1 + r) a frame.

    The springs at the bone are not viscous; in the first frame they take more.
    """
    plain, frame = FleshLayer(limb(Region.fixed)), Frame("held", {}, {"core": RigidTransform.identity()})
    still, tissue = below(), plain.tissue
    rest = plain.solve(frame, still)["flesh_mesh"].vertices
    strains = np.tile([1.02, 0.0, 0.0, 1.0, 0.0, 1.0], (len(tissue.mesh.tets), 1))
    rigid = {name: frame.bones[part.bone] for name, part in tissue.rigid.items()}
    x = settled_from(LoadCase.of(tissue, still, rigid, strains), rest).x
    layer, left = plain.viscous(ratio), []
    for _ in range(4):
        left.append(np.linalg.norm(x - rest))
        mesh = Shape(tissue.mesh.vertices, x, tissue.mesh.tets)
        shapes = layer.solve_after((frame, {**still, "flesh": {"flesh_mesh": mesh}}), frame, still)
        x = shapes["flesh_mesh"].vertices
    np.testing.assert_allclose(np.divide(left[2:], left[1:-1]), ratio / (1 + ratio), rtol=0.04)
    np.testing.assert_array_equal(layer.solve(frame, still)["flesh_mesh"].vertices, rest)
