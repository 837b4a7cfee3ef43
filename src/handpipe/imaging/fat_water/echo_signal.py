"""The signal of a voxel with fat and water at several echo times, and the best fit to it.

At the time t a voxel has the signal exp(i phi + 2 pi i psi t) (W + F c(t)): W and F are real, phi is the
phase of coil and pulse, psi the frequency by which the field is off, and c(t) the sum of fat's peaks. With
one phase for W and F the best fit for given psi has a closed form (Bydder 2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array

GYROMAGNETIC = 42.577  # MHz/T of hydrogen
PEAKS = np.array(
    [-3.80, -3.40, -2.60, -1.94, -0.39, 0.60]
)  # ppm from water's, of triglycerides: Hamilton 2011
SHARES = np.array([0.087, 0.693, 0.128, 0.004, 0.039, 0.048])  # of the peaks, in the same order
MAIN_PEAK = -3.4  # ppm from water's
INDISTINCT = 0.1  # of the squared length of a column: what is left of fat's signal beside water's

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class EchoSignal:
    """What fat and water of amplitude 1 send at the echo times of an acquisition.

    Parameters
    ----------
    times : array (n,)
        Echo times in s, increasing.
    tesla : float
        Field strength in T.

    References
    ----------
    Hamilton 2011 (NMR Biomed 24, fat's peaks); Bydder 2011 (Magn Reson Imaging 29, one phase for both).
    """

    times: Array
    tesla: float

    @cached_property
    def matrix(self) -> Complex:
        """Signals (n, 2) of water and of fat."""
        hertz = GYROMAGNETIC * self.tesla * PEAKS
        fat = np.exp(2j * np.pi * np.outer(self.times, hertz)) @ SHARES
        return np.stack([np.ones(len(self.times)), fat], axis=1)

    @cached_property
    def fat_shift(self) -> float:
        """Frequency of fat's main peak from water's, in Hz, without its sign."""
        return abs(GYROMAGNETIC * self.tesla * MAIN_PEAK)

    @property
    def distinct(self) -> bool:
        """Whether fat's signal is more than water's with another phase."""
        water, fat = self.matrix.T
        alike = np.abs(np.vdot(water, fat)) ** 2 / (np.vdot(water, water) * np.vdot(fat, fat)).real
        return bool(1 - alike > INDISTINCT)

    @cached_property
    def _gram(self) -> Array:
        return np.asarray((self.matrix.conj().T @ self.matrix).real)

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self._gram))

    def residuals(self, signals: Complex, fields: Array) -> Array:
        """What the best fit leaves of the signals' energy; neither W nor F may be negative.

        signals (m, n), fields (m, k) or (k,) in Hz; returns (m, k).
        """
        water, fat = self._demodulated(signals, fields)
        inverse, gram = self._inverse, self._gram
        cross = 2 * inverse[0, 1]
        whole = inverse[0, 0] * abs2(water) + inverse[1, 1] * abs2(fat) + cross * (water * fat.conj()).real
        turned = inverse[0, 0] * water**2 + inverse[1, 1] * fat**2 + cross * water * fat
        amount = np.abs(turned)
        # With the best phase the amplitudes have these products with one another's projections.
        phase = np.sqrt(np.where(amount > 0, turned / np.where(amount > 0, amount, 1), 1)).conj()
        w, f = (water * phase).real, (fat * phase).real
        both = (inverse[0, 0] * w + inverse[0, 1] * f) * (inverse[0, 1] * w + inverse[1, 1] * f) >= 0
        alone = np.maximum(abs2(water) / gram[0, 0], abs2(fat) / gram[1, 1])
        explained = np.where(both, 0.5 * (whole + amount), alone)
        return abs2(signals).sum(axis=1)[:, None] - explained

    def amplitudes(self, signals: Complex, field: Array) -> tuple[Array, Array]:
        """Water and fat (m,) of signals (m, n) in a known field (m,) in Hz; noise may make one negative."""
        found = np.stack([part[:, 0] for part in self._demodulated(signals, field[:, None])], axis=1)
        turned = np.einsum("mi,ij,mj->m", found, self._inverse, found)
        both = (found * np.exp(-0.5j * np.angle(turned))[:, None]).real @ self._inverse
        both *= np.where(both.sum(axis=1) < 0, -1, 1)[:, None]
        return both[:, 0], both[:, 1]

    def _demodulated(self, signals: Complex, fields: Array) -> tuple[Complex, Complex]:
        """Products (m, k) of the signals, turned back by the field, with water's and fat's."""
        turn = np.exp(-2j * np.pi * self.times * np.atleast_2d(fields)[..., None])
        turned = signals[:, None, :] * turn
        water, fat = (turned @ self.matrix.conj()[:, i] for i in (0, 1))
        return water, fat


def abs2(values: Complex) -> Array:
    """Squared absolute values."""
    return np.asarray(values.real**2 + values.imag**2)
