"""A tissue bent in steps: prongs pressed flat, a body on its way, and poses that need no steps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.fem.elements.validity import Validity
from handpipe.mesh.contact.crossing_triangles import crossings
from handpipe.tissues.fat.bending.bodies import Bodies
from handpipe.tissues.fat.bending.path import Origin
from handpipe.tissues.fat.constraints import inner_points
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.skin_contact import DISTANCE, overlap
from handpipe.tissues.fat.tissue import Tissue

from .limb import capsule
from .test_skin_on_skin import SIDES, below, core, tissue, together

STILL = dict.fromkeys(("palm", *SIDES), RigidTransform.identity())


@cache
def fork() -> Tissue:
    """The prongs, with their tree of bones."""
    return replace(tissue(), parents=dict.fromkeys(SIDES, "palm"))


def frame(motions) -> Frame:
    return Frame("pressed", {}, {**STILL, **motions})


@pytest.mark.parametrize("distance", [3.2, 3.6])
def test_prongs_that_pushes_do_not_part_are_bent_there(distance):
    """The bones leave little room: the sheets stay two, one on each side of the middle."""
    posed, pressed = below(together(distance)), frame(together(distance))
    with pytest.raises(ConvergenceError, match="crossings of the skin with itself"):
        TissueLayer("fat", tissue()).solve(pressed, posed)
    shapes = TissueLayer("fat", fork()).solve(pressed, posed)
    skin = shapes["skin"]
    assert len(crossings(fork().skin.moved(skin.vertices))) == 0
    assert 0 < skin.figures["skin_gap"] < DISTANCE and skin.figures["contact_unsettled"] == 0
    x, y, z = skin.vertices.T
    between = (np.abs(x - 12.5) < 5) & (np.abs(z) < 2.0) & (np.abs(y) < 0.4)
    sides = np.sign(fork().skin.vertices[between, 1])
    assert min((sides > 0).sum(), (sides < 0).sum()) > 10
    assert y[between][sides > 0].mean() > 0 > y[between][sides < 0].mean() and abs(y[between].mean()) < 0.02
    assert Validity.check(fork().mesh.vertices, fork().mesh.tets, shapes["fat_mesh"].vertices).inverted == 0


def test_it_rests_where_forces_balance():
    """Forces of flesh and constraints are those of the barrier, at a pose that pushes do not reach."""
    posed, pressed = below(together(3.2)), frame(together(3.2))
    layer = TissueLayer("fat", fork())
    x, case = layer.solve(pressed, posed)["fat_mesh"].vertices, layer.load_case(pressed.bones, posed)
    force = fork().skin_barrier().gradient(x)
    others = [case.elastic, *case.constraints(x, contact=[])]
    left = np.linalg.norm(sum(p.gradient(x) for p in others) + force, axis=1)
    assert left.max() < 0.02 * np.linalg.norm(force, axis=1).max()


def test_from_a_frame_whose_skin_touches_it_is_bent_on():
    """Opened again from the pressed frame, it has the shape of a frame that never touched."""
    layer = TissueLayer("fat", fork())
    pressed, free = frame(together(3.2)), frame(together(1.0))
    before = pressed, {**below(together(3.2)), "fat": layer.solve(pressed, below(together(3.2)))}
    again = layer.solve_after(before, free, below(together(1.0)))["skin"].vertices
    alone = layer.solve(free, below(together(1.0)))["skin"].vertices
    assert np.linalg.norm(again - alone, axis=1).max() < 0.02


def test_bodies_are_known_at_both_ends_and_go_with_their_bones_between():
    """A soft body on a bone that goes 4 mm aside and swells by 1 mm is half way aside and half swollen."""
    soft = capsule(1.5, 1.0, length=10.0)
    rest = soft.vertices + [12.5, 5.0, 0.0]
    belly = Shape(rest, rest, soft.triangles)
    first = {"muscles": {"belly": belly}}
    body = replace(fork(), inner=inner_points(first, ("muscles",), core(SIDES["left"]), 2.0))
    aside = RigidTransform(np.eye(3), np.array([0.0, 4.0, 0.0]))
    swollen = rest + soft.vertex_normals()
    bones = {**STILL, "left": aside}
    last = {"muscles": {"belly": replace(belly, vertices=aside(swollen))}}
    way = Bodies(body, STILL, bones, first, last)
    for share, transforms, expected in (
        (0.0, STILL, rest),
        (1.0, bones, aside(swollen)),
        (0.5, {**STILL, "left": RigidTransform(np.eye(3), np.array([0.0, 2.0, 0.0]))}, None),
    ):
        found = way.at(transforms, share)["muscles"]["belly"].vertices
        if expected is None:
            expected = 0.5 * (rest + swollen) + [0.0, 2.0, 0.0]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_bones_that_the_tissue_does_not_touch_go_along():
    """As where fasciae cover them: contact of the skin with bones needs them on the way, too."""
    bones = below(together(2.0))["bones"]
    rest = {name: replace(bone, vertices=bone.rest) for name, bone in bones.items()}
    covered = replace(fork().inner, layers=("bone_fascia",) * len(fork().inner.layers))
    known = {"bones": rest, "bone_fascia": {name: rest[name] for name in fork().inner.bodies}}
    way = Bodies(replace(fork(), inner=covered), STILL, STILL, known, known).at(STILL, 0.5)
    assert way["bones"].keys() == rest.keys()


def test_neutral_is_where_all_bodies_are_at_rest():
    posed = below(together(2.0))
    origin = Origin.neutral(fork(), posed)
    for name, shape in origin.bodies["bones"].items():
        np.testing.assert_array_equal(shape.vertices, posed["bones"][name].rest)
    np.testing.assert_array_equal(origin.x, fork().mesh.vertices)


def test_sheets_that_face_one_another_without_crossing_do_not_overlap():
    """A clenched fold's sheets seem to lie in one another; where no edge crosses a triangle they do not."""
    layer = TissueLayer("fat", fork())
    skin = layer.solve(frame(together(3.6)), below(together(3.6)))["skin"]
    assert overlap(fork().skin, fork().skin.moved(skin.vertices)) == 0
    crossed = skin.vertices + 0.3 * np.sign(fork().skin.vertices[:, [1]]) * [0.0, -1.0, 0.0]
    assert overlap(fork().skin, fork().skin.moved(crossed)) > 0.3
