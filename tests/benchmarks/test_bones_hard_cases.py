"""Each hard case, on two small bones in three poses: what goes wrong is noticed and kept from the rig."""

import pytest
from benchmarks.bones.cases import CASES
from benchmarks.bones.hard_cases import Bars, measure
from benchmarks.bones.subject import SMALL

# Small bones overlap less, and a joint's residual motion cannot be learnt from two poses.
BARS = Bars(dice_mean=0.95, dice_min=0.9, fitted=(1.0, 0.3), left_out=(6.0, 1.5))


@pytest.mark.parametrize("name", CASES)
def test_hard_case(name: str) -> None:
    assert measure(name, SMALL, BARS).failures == []
