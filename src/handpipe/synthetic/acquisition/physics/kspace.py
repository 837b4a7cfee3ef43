"""In k-space: fat's shift, folding, ghosts of motion, lines that are not acquired, complex noise.

The first axis of an image is the readout, the second one the phase direction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from handpipe.synthetic.acquisition.physics.effects import BANDWIDTH, Effects
from handpipe.synthetic.acquisition.physics.sequences import Sequence, frequency

Complex = NDArray[np.complex64]
NEIGHBOUR = 0.55  # of the field of view along the phase direction: where what folds in appears
BREATH = 8.3  # lines of one period of the motion


def of_fat(n: int, sequence: Sequence, hertz: float | None) -> Complex:
    """What turns k-space of fat (n, …) into that of its peaks at the echo, as a factor (n,) of each sample.

    hertz: bandwidth in Hz/voxel, over which a peak's frequency is its shift along the readout; None: none.
    """
    factor = np.zeros(n, np.complex128)
    for (ppm, _), signal in zip(sequence.spectrum, sequence.fat_peaks, strict=True):
        voxels = 0.0 if hertz is None else frequency(sequence.field, ppm) / hertz
        factor += signal * shift(n, voxels)
    return factor.astype(np.complex64)


def shift(n: int, voxels: float) -> NDArray[np.complex128]:
    """Factor (n,) of k-space of an image that moves along the readout by a number of voxels, periodically."""
    return np.exp(-2j * np.pi * fft.fftfreq(n) * voxels)


def folded(k: Complex, share: float, place: float = NEIGHBOUR) -> Complex:
    """k-space with a neighbour's signal, which folds to `place` of the field of view."""
    shift = round(place * k.shape[1])
    turns = 1.0 + share * np.exp(-2j * np.pi * fft.fftfreq(k.shape[1]) * shift)
    return k * turns.astype(np.complex64)[:, None]


def moved(k: Complex, voxels: float, rng: np.random.Generator) -> Complex:
    """k-space of an image that swings along the phase direction by an amplitude in voxels.

    A line is sampled at a time proportional to its number, so the swing differs from line to line.
    """
    n = k.shape[1]
    frequency = fft.fftfreq(n)
    time = np.round(frequency * n) / BREATH + rng.uniform()
    turns = np.exp(-2j * np.pi * frequency * voxels * np.sin(2.0 * np.pi * time))
    return k * turns.astype(np.complex64)[:, None]


def acquired(shape: tuple[int, ...], effects: Effects) -> NDArray[np.bool_]:
    """Which samples (nx, ny, 1) of k-space are acquired; zeros fill the rest."""
    x, y = fft.fftfreq(shape[0]), fft.fftfreq(shape[1])
    share = effects.size("gibbs") or 1.0
    lines = np.abs(y) <= 0.5 * share
    if part := effects.size("partial_fourier"):
        lines &= y >= (0.5 - part) * share
    return ((np.abs(x) <= 0.5 * share)[:, None] & lines)[..., None]


def noisy(k: Complex, deviation: float, rng: np.random.Generator) -> Complex:
    """k-space with complex noise, whose deviation in each channel is that of the image of all samples."""
    noise = rng.standard_normal((2, *k.shape), dtype=np.float32)
    return k + np.float32(deviation) * (noise[0] + 1j * noise[1])


def bandwidth(effects: Effects) -> float:
    """Readout bandwidth in Hz/voxel."""
    return effects.size("chemical_shift") or BANDWIDTH
