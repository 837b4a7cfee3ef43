"""The one-dimensional string of Wang 2021 §5.9.5."""

import numpy as np
import pytest
from benchmarks.shapes import string

CELLS = 24


def test_slopes_follow_the_marks_and_do_not_wiggle() -> None:
    positions = string.profile(string.fitted(CELLS), CELLS)
    assert positions[[0, -1]] == pytest.approx([0.0, 2.0], abs=0.01)
    assert string.slopes(positions) == pytest.approx([1.0, 5.0, 1.0], rel=0.05)
    assert (np.diff(positions) > 0).all()  # a variational curve folds over here
    middles = (np.arange(CELLS) + 0.5) / CELLS
    assert string.variational(3, middles).min() < 0
    assert string.overshoot(np.diff(positions) * CELLS) < string.overshoot(string.variational(3, middles))


@pytest.mark.parametrize("order", [2, 3])
def test_variational_curves_meet_the_marks(order: int) -> None:
    fine = (np.arange(4000) + 0.5) / 4000
    positions = np.concatenate([[0.0], np.cumsum(string.variational(order, fine)) / 4000])
    assert positions[[1000, 2000, 4000]] == pytest.approx([0.25, 1.5, 2.0], abs=1e-4)
