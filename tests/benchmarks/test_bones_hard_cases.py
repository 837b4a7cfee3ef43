"""Each hard case, on two small bones in few poses: what goes wrong is noticed and kept from the rig."""

import pytest
from benchmarks.bones.cases import CASES
from benchmarks.bones.hard_cases import Bars, measure
from benchmarks.bones.subject import NEUTRAL, Part
from tests.sampling import every

BONES = ("middle2", "distal2")
# So few poses tell nothing of left-out ones; of so few bones one alarm is allowed; small bones overlap less.
BARS = Bars(dice_mean=0.95, motion_mean=(0.5, 0.1), left_out=None, alarms=0.25)
# What is not managed today, as measured. A case that comes good fails here until it is taken out.
REASON = "the roll of a distal phalanx is known to one or two degrees in slices or voxels of 1 mm"
COARSE = pytest.mark.xfail(strict=True, reason=REASON)
FAILING = {"voxels-1": COARSE, "slices-1": COARSE}


@pytest.mark.parametrize("name", every(3, [name for name in CASES if name != "twelve-poses"], FAILING))
def test_hard_case(name: str) -> None:
    poses = ("hook", "spread") if CASES[name].altered else ("hook",)
    assert measure(name, Part(BONES, (NEUTRAL, *poses)), BARS).failures == []
