"""Signal of water and fat of a tissue by the equations of spin echo and spoiled gradient echo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from handpipe.synthetic.acquisition.physics.relaxation import TISSUES, Tissue

GYROMAGNETIC = 42.577  # MHz/T of the proton
FAT_SHIFT = -3.4  # ppm of fat's main peak from water
Name = Literal["spin_echo", "gradient_echo_in_phase", "gradient_echo_opposed"]


def fat_frequency(field: float) -> float:
    """Frequency of fat's main peak from water in Hz at a field in T."""
    return FAT_SHIFT * GYROMAGNETIC * field


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
    """

    field: float
    repetition: float
    echo: float
    flip: float | None = None

    @staticmethod
    def named(name: Name, field: float) -> Sequence:
        """A usual sequence at a field in T.

        The spin echo has the times of Wang 2019 §3.1's volumes. The gradient echo has the angle, the
        repetition and (at 3 T) the echo times of the Dixon series that the model is calibrated on; the
        echoes are the second in phase and the first opposed one after it starts to dephase.
        """
        if name == "spin_echo":
            return Sequence(field, 1500.0, 25.93)
        turn = 1e3 / abs(fat_frequency(field))  # ms in which fat turns once from water
        return Sequence(field, 23.0, turn * (2.0 if name == "gradient_echo_in_phase" else 1.5), 5.0)

    def signal(self, tissue: Tissue) -> tuple[complex, complex]:
        """Complex signal of a tissue's water and of its fat; 1 is pure water without relaxation."""
        times = tissue.at(self.field)
        recovery = float(np.exp(-self.repetition / times.t1))
        if self.flip is None:
            level = (1.0 - recovery) * float(np.exp(-self.echo / times.t2))
        else:
            angle = np.radians(self.flip)
            level = float(np.sin(angle) * (1.0 - recovery) / (1.0 - np.cos(angle) * recovery))
            level *= float(np.exp(-self.echo / times.t2_star))
        level *= tissue.density
        return level * (1.0 - tissue.fat), level * tissue.fat * self.fat_phase

    @property
    def fat_phase(self) -> complex:
        """Phase of fat's signal relative to water's at the echo, as a complex number of magnitude 1."""
        if self.flip is None:  # a spin echo refocuses it
            return 1.0 + 0.0j
        return complex(np.exp(2e-3j * np.pi * fat_frequency(self.field) * self.echo))

    @property
    def reference(self) -> float:
        """Magnitude of yellow marrow's signal, which noise is relative to."""
        return abs(sum(self.signal(TISSUES["marrow"])))
