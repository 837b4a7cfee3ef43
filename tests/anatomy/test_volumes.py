"""Scales that meet volumes, on made-up dependences of volumes on scales."""

import numpy as np
import pytest

from handpipe.anatomy.templates.volumes import meet_volumes
from handpipe.core.errors import ConvergenceError


def test_neighbours_that_take_room_from_one_another() -> None:
    powers = np.array([[0.0, 0, 0], [0, 2.0, -0.6], [0, -0.8, 4.0]])

    def volumes_of(scales: np.ndarray) -> np.ndarray:
        return np.array([1000.0, 500, 200]) * np.exp(powers @ np.log(scales))

    targets = np.array([np.nan, 900.0, 150.0])
    scales = meet_volumes(targets, volumes_of, "xyz")
    assert scales[0] == 1
    np.testing.assert_allclose(volumes_of(scales)[1:], targets[1:], rtol=0.0101)


def test_muscle_that_is_nowhere_at_first() -> None:
    scales = meet_volumes(np.array([100.0]), lambda s: np.maximum(400 * (s - 1.2), 0.0), "x")
    np.testing.assert_allclose(400 * (scales - 1.2), 100, rtol=0.0101)


def test_volume_that_there_is_no_room_for() -> None:
    with pytest.raises(ConvergenceError, match="volume of y"):
        meet_volumes(np.array([np.nan, 100.0]), lambda s: np.minimum(50 * s, 80.0), "xy")
