"""Organs that follow a bone in doubt are told which bones these are."""

from pathlib import Path

import numpy as np

from handpipe.core import RigidTransform
from handpipe.skeleton.bones import write_registrations
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.stages.poses import doubted_bones


def test_bones_in_doubt_are_found_among_those_that_are_asked_for(tmp_path: Path) -> None:
    sure = Registration(RigidTransform.identity(), 0.1, np.eye(6))
    unsure = Registration(RigidTransform.identity(), 0.1, np.eye(6), doubt="it fits when turned, too")
    path = tmp_path / "registration.h5"
    write_registrations(path, {"proximal2": sure, "middle2": unsure, "distal2": unsure})
    assert doubted_bones(path, ["proximal2", "middle2", "absent"]) == {"middle2": unsure.doubt}
    assert doubted_bones(path, ["proximal2"]) == {}
