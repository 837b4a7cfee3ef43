"""Signal of water and fat of a tissue by the equations of spin echo and spoiled gradient echo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from handpipe.synthetic.acquisition.physics.relaxation import TISSUES, TissueSignal

GYROMAGNETIC = 42.577  # MHz/T of the proton
FAT_SHIFT = -3.4  # ppm of fat's main peak from water
# Peaks of human fat: ppm from water, share of the protons (Hamilton 2011, NMR Biomed 24:784). Those beside
# the main one keep fat from ever being wholly in phase or opposed.
FAT_SPECTRUM = (
    (-3.8, 0.088),
    (FAT_SHIFT, 0.694),
    (-2.6, 0.128),
    (-1.94, 0.004),
    (-0.39, 0.039),
    (0.6, 0.047),
)
Spectrum = tuple[tuple[float, float], ...]
Name = Literal["spin_echo", "gradient_echo_in_phase", "gradient_echo_opposed"]


def frequency(field: float, shift: float = FAT_SHIFT) -> float:
    """Frequency in Hz of a chemical shift in ppm, by default of fat's main peak, at a field in T."""
    return shift * GYROMAGNETIC * field


@dataclass(frozen=True)
class Sequence:
    """A pulse sequence.

    Parameters
    ----------
    field : float
        Field strength in T, 1.5 or 3.
    repetition, echo : float
        Repetition and echo time in ms.
    flip : float
        Flip angle in degrees of a spoiled gradient echo; None for a spin echo.
    spectrum : tuple of (float, float)
        Peaks of fat: chemical shift from water in ppm, and share.
    """

    field: float
    repetition: float
    echo: float
    flip: float | None = None
    spectrum: Spectrum = FAT_SPECTRUM

    @staticmethod
    def named(name: Name, field: float) -> Sequence:
        """A usual sequence at a field in T.

        The spin echo has the times of Wang 2019 §3.1's volumes. The gradient echo has the angle, the
        repetition and (at 3 T) the echo times of the Dixon series that the model is calibrated on; the
        echoes are the second in phase and the first opposed one after it starts to dephase.
        """
        if name == "spin_echo":
            return Sequence(field, 1500.0, 25.93)
        turn = 1e3 / abs(frequency(field))  # ms in which fat turns once from water
        return Sequence(field, 23.0, turn * (2.0 if name == "gradient_echo_in_phase" else 1.5), 5.0)

    def signal(self, tissue: TissueSignal) -> tuple[complex, complex]:
        """Complex signal of a tissue's water and of its fat; 1 is pure water without relaxation."""
        water, fat = self.levels(tissue)
        return complex(water), fat * sum(self.fat_peaks)

    def levels(self, tissue: TissueSignal) -> tuple[float, float]:
        """Magnitude of a tissue's water, and of its fat if its peaks were in phase."""
        times = tissue.at(self.field)
        recovery = float(np.exp(-self.repetition / times.t1))
        if self.flip is None:
            level = (1.0 - recovery) * float(np.exp(-self.echo / times.t2))
        else:
            angle = np.radians(self.flip)
            level = float(np.sin(angle) * (1.0 - recovery) / (1.0 - np.cos(angle) * recovery))
            level *= float(np.exp(-self.echo / times.t2_star))
        level *= tissue.density
        return level * (1.0 - tissue.fat), level * tissue.fat

    @property
    def fat_peaks(self) -> list[complex]:
        """Signal of each peak of fat at the echo, of magnitude 1 in all where they are in phase."""
        if self.flip is None:  # a spin echo refocuses their phases
            return [complex(share) for _, share in self.spectrum]
        turns = 1e-3 * self.echo
        return [
            share * complex(np.exp(2j * np.pi * frequency(self.field, shift) * turns))
            for shift, share in self.spectrum
        ]

    @property
    def reference(self) -> float:
        """Magnitude of yellow marrow's signal, which noise is relative to."""
        return abs(sum(self.signal(TISSUES["marrow"])))
