"""The artifact of the neutral skin."""

import re
from pathlib import Path

import numpy as np
import pytest
from tests.mesh.shapes import sphere

from handpipe.core import artifacts
from handpipe.core.errors import InputError
from handpipe.core.layers import Shape
from handpipe.stages.tissues.tissue import require_inside
from handpipe.tissues.fat.skin import Rigid, Skin

from .limb import SKIN, capsule


@pytest.mark.parametrize(
    "rigid", [{}, {"nail": Rigid("tip", np.array([3, 4, 9])), "cut_end": Rigid("base", np.array([0]))}]
)
def test_a_skin_survives_its_artifact(tmp_path, rigid):
    surface = capsule(SKIN, 2.0)
    Skin(surface, rigid).save(tmp_path / "skin.h5", [])
    again = Skin.load(tmp_path / "skin.h5")
    np.testing.assert_array_equal(again.surface.vertices, surface.vertices)
    np.testing.assert_array_equal(again.surface.triangles, surface.triangles)
    assert set(again.rigid) == set(rigid)
    for name, part in rigid.items():
        assert again.rigid[name].bone == part.bone
        np.testing.assert_array_equal(again.rigid[name].vertices, part.vertices)


def test_an_artifact_of_another_kind_is_refused(tmp_path):
    artifacts.write(tmp_path / "other.h5", {"x": 1.0}, kind="other")
    with pytest.raises(InputError, match="skin"):
        Skin.load(tmp_path / "other.h5")


def _ball() -> Skin:
    """A skin of 10 mm, cut below -8 mm."""
    ball = sphere(10.0, 4)
    return Skin(ball, {"cut_end": Rigid("base", np.flatnonzero(ball.vertices[:, 2] < -8.0))})


def test_points_are_outside_but_where_the_limb_goes_on():
    points = np.array([[0.0, 0.0, 12.0], [13.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, -15.0]])
    np.testing.assert_allclose(_ball().outside(points), [2.0, 3.0, 0.0, 0.0], atol=0.05)


@pytest.mark.parametrize(("height", "said"), [(9.0, ""), (11.0, "named"), (14.0, "refused")])
def test_a_body_outside_of_the_skin_is_named_and_far_outside_refused(height, said, caplog):
    """A bone that reaches up to a height, and down beyond the cut end."""
    bone = sphere(1.0, 3)
    bone = bone.moved(bone.vertices * [1.0, 1.0, 0.5 * (height + 20.0)] + [0.0, 0.0, 0.5 * (height - 20.0)])
    shape = Shape(bone.vertices, bone.vertices, bone.triangles)
    asked = {"bones": {"ulna": shape}}, _ball(), Path("inner.h5")
    place = rf"lies up to {height - 10:.1f} mm outside of the skin, near \(-?0\.0, -?0\.0, {height:.1f}\) mm"
    if said == "refused":
        with pytest.raises(InputError, match="inner.h5: bones: ulna: " + place):
            require_inside(*asked)
        return
    require_inside(*asked)
    assert bool(re.search("bones: ulna " + place, caplog.text)) == (said == "named")
    assert len(caplog.records) == (said == "named")
