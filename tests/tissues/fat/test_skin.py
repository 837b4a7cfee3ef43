"""The artifact of the neutral skin."""

import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.core.errors import InputError
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
