"""How far a ball, which is the bone, comes out of a larger one, which is the skin."""

import numpy as np
import pytest
import trimesh

from handpipe.core.layers import Shape
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.fat.hidden_bones import HiddenBones


def ball(radius: float, subdivisions: int = 4) -> Surface:
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Surface(np.array(made.vertices), np.array(made.faces))


def test_the_distance_is_that_of_the_balls() -> None:
    skin, bone = ball(8.0), ball(4.0)
    hidden = HiddenBones(skin)
    for shift in (0.0, 3.8, 5.0, 7.0):
        posed = Shape(bone.vertices, bone.vertices + [0.0, shift, 0.0], bone.triangles)
        expected = max(shift + 4.0 - 8.0, 0.0)
        assert hidden.outside(skin, {"bone": posed}) == pytest.approx(expected, abs=0.06)


def test_what_the_neutral_skin_does_not_hide_does_not_count() -> None:
    """A bone that the cut end of a limb leaves half outside."""
    skin, bone = ball(8.0), ball(4.0)
    cut = Shape(bone.vertices + [0.0, 8.0, 0.0], bone.vertices + [0.0, 8.0, 0.0], bone.triangles)
    hidden = HiddenBones(skin)
    assert hidden.outside(skin, {"cut": cut}) == 0.0
    assert hidden.outside(skin, {}) == 0.0
    lifted = Shape(cut.rest, cut.vertices + [0.0, 1.0, 0.0], bone.triangles)
    # watched vertices are a millimetre apart: the highest that the neutral skin hides is a little below it
    assert 0.75 < hidden.outside(skin, {"cut": lifted}) <= 1.0
