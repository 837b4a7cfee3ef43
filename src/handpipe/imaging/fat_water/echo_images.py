"""Magnitudes and phases of a pose's echoes, as its dataset names them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.fat_water.echo_signal import Complex, EchoSignal
from handpipe.imaging.volumes import Volume, pose_volume, read_channel

# A whole turn of phase in files: radians, degrees, thousandths of radians, whole numbers of 10 to 16 bits.
TURNS = (2 * np.pi, 360.0, 2000 * np.pi, *(2.0**n for n in range(10, 17)))
FILLED = 0.95  # of a turn, which the phase of noise covers at least
MILLISECOND = 1e-3  # s
ROUNDED = 1e-3  # of a turn, by which rounded phases may exceed it


@dataclass(frozen=True)
class EchoImages:
    """The echoes of a pose.

    signals (nx, ny, nz, n), complex; grid: the pose's volume, for its lattice; echoes: when they were read.
    """

    signals: Complex
    grid: Volume
    echoes: EchoSignal


def read_echoes(dataset: Dataset, pose: str) -> EchoImages:
    """The echoes of a pose, as complex signals on the lattice of its volume.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the subject.
    pose : str
        Name of a pose that has `dixon`.

    Returns
    -------
    EchoImages
        Signals, lattice and echo times.

    Raises
    ------
    InputError
        As `read_channel` does; where a phase has an unknown unit, and where fat and water have the same
        signal at the echo times.
    """
    dixon = dataset.poses[pose].dixon
    if dixon is None:
        raise InputError(f"poses.{pose}", "dixon", "is not given", "Name the echoes")
    echoes = EchoSignal(np.array([echo.time_ms for echo in dixon.echoes]) * MILLISECOND, dixon.field_T)
    if not echoes.distinct:
        problem = "fat's signal differs from water's by a phase alone at these times"
        raise InputError(f"poses.{pose}.dixon", "time_ms", problem, "Check the times and field_T")
    grid = pose_volume(dataset, pose)
    signals = [
        _signal(dataset.path(echo.magnitude), dataset.path(echo.phase), grid)
        for echo in dixon.echoes
        if echo.phase is not None  # checked when the dataset is loaded
    ]
    return EchoImages(np.stack(signals, axis=-1), grid, echoes)


def _signal(magnitude: Path, phase: Path, grid: Volume) -> NDArray[np.complex128]:
    turns = radians(phase, read_channel(phase, grid).values.astype(float))
    return np.asarray(read_channel(magnitude, grid).values * np.exp(1j * turns))


def radians(path: Path, phase: Array) -> Array:
    """A phase in radians, but for a constant; its unit follows from the range of its values.

    Raises `InputError` where the range is that of no unit.
    """
    low, high = float(phase.min()), float(phase.max())
    for turn in TURNS:
        if FILLED * turn <= high - low <= turn * (1 + ROUNDED):
            return phase * (2 * np.pi / turn)
    problem = f"values from {low:g} to {high:g} are no whole turn in a known unit"
    raise InputError(path, "phase", problem, "Write the phase of the whole image in radians")
