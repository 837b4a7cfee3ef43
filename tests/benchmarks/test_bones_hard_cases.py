"""Each hard case, on two small bones in one pose: what goes wrong is noticed and kept from the rig."""

import pytest
from benchmarks.bones.cases import CASES
from benchmarks.bones.hard_cases import Bars, measure
from benchmarks.bones.subject import NEUTRAL, Part

BONES = ("middle2", "distal2")
# One pose tells nothing of left-out ones; of four bones one alarm is allowed; small bones overlap less.
BARS = Bars(dice_mean=0.95, motion_mean=(0.5, 0.1), left_out=None, alarms=0.25)


@pytest.mark.parametrize("name", CASES)
def test_hard_case(name: str) -> None:
    poses = tuple(CASES[name].altered) or ("hook",)
    assert measure(name, Part(BONES, (NEUTRAL, *poses)), BARS).failures == []
