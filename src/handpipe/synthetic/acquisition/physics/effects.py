"""What real images have that painted ones have not, by name, and how strong it usually and at worst is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

from handpipe.core.configuration import ImageEffect, Strength


@dataclass(frozen=True)
class Amount:
    """Size of an effect at usual and at severe strength, with unit, and what it means."""

    usual: float
    severe: float
    unit: str
    what: str


AMOUNTS: dict[ImageEffect, Amount] = {
    "coil": Amount(0.5, 0.2, "1", "sensitivity at the far side of the subject over that at the near side"),
    "noise": Amount(0.03, 0.1, "1", "deviation of complex noise over the marrow's signal"),
    "chemical_shift": Amount(
        440.0, 220.0, "Hz/voxel", "readout bandwidth, over which fat's frequency is a shift"
    ),
    "gibbs": Amount(0.8, 0.6, "1", "share of the matrix acquired in the plane; beyond it zeros"),
    "partial_fourier": Amount(0.75, 0.625, "1", "share of the phase lines acquired, zeros for the rest"),
    "ghosts": Amount(0.15, 0.5, "mm", "amplitude of a periodic motion along the phase direction"),
    "slice_profile": Amount(1.2, 2.5, "voxels", "full width at half maximum of a Gaussian slice profile"),
    "slice_thickness": Amount(1.5, 3.0, "voxels", "thickness of slices, interpolated to the grid"),
    "wrap": Amount(0.15, 0.5, "1", "signal of a neighbour that folds into the field of view"),
    "distortion": Amount(60.0, 200.0, "Hz", "largest deviation of the static field over the subject"),
    "vessels_void": Amount(0.4, 0.8, "mm", "radius of vessels without signal"),
    "vessels_bright": Amount(0.4, 0.8, "mm", "radius of vessels with the signal of resting blood"),
    "nerves": Amount(0.5, 1.0, "mm", "radius of nerves"),
    "muscle_streaks": Amount(0.25, 0.6, "mm", "thickness of streaks of fat and of septa in muscle"),
    "joints": Amount(2.5, 4.0, "mm", "width up to which cartilage and fluid fill the gap of two bones"),
    "skin": Amount(1.2, 2.2, "mm", "thickness of the dermis"),
    "septa": Amount(0.15, 0.4, "mm", "thickness of septa in subcutaneous fat"),
    "palmar_fascia": Amount(0.5, 1.0, "mm", "thickness of the palmar fascia"),
    "trabeculae": Amount(0.9, 1.1, "1", "share of marrow among trabeculae at a bone's ends"),
}
BANDWIDTH = 440.0  # Hz/voxel that turns a field's deviation into a shift, unless chemical_shift says
EFFECTS: tuple[ImageEffect, ...] = get_args(ImageEffect)


@dataclass(frozen=True)
class Effects:
    """Strengths of effects.

    Parameters
    ----------
    strengths : mapping of str to str
        "none", "usual" or "severe" by the name of the effect.
    others : str, optional
        Strength of effects that `strengths` does not name.
    """

    strengths: Mapping[ImageEffect, Strength]
    others: Strength = "none"

    def size(self, name: ImageEffect) -> float | None:
        """Size of an effect in its unit, or None where it is off."""
        strength = self.strengths.get(name, self.others)
        return None if strength == "none" else float(getattr(AMOUNTS[name], strength))
