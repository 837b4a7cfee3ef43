"""How the images of a generated subject come about."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, field_validator

from handpipe.core.configuration.model import Model, Name

Strength = Literal["none", "usual", "severe"]
ImageEffect = Literal[
    "coil",
    "noise",
    "chemical_shift",
    "gibbs",
    "partial_fourier",
    "ghosts",
    "slice_profile",
    "slice_thickness",
    "wrap",
    "distortion",
    "vessels_void",
    "vessels_bright",
    "nerves",
    "muscle_streaks",
    "joints",
    "skin",
    "septa",
    "palmar_fascia",
    "trabeculae",
]


class Scanner(Model):
    """How a generated subject is imaged, where its generator asks."""

    spacing: float = Field(default=0.5, ge=0.2, le=3.0, description="voxel size in mm")
    bias: float = Field(default=0.2, ge=0, lt=1, description="amplitude of the bias field, as a share")
    noise: float = Field(
        default=0.03,
        ge=0,
        le=1,
        description="deviation of the Rician noise, as a share of marrow's intensity",
    )


class Images(Model):
    """How the images of a generated subject are made."""

    model: Literal["painted", "physics"] = Field(
        default="painted",
        description="levels painted by tissue, or signal equations and artefacts",
    )
    sequence: Literal["spin_echo", "gradient_echo_in_phase", "gradient_echo_opposed"] = "spin_echo"
    field: float = Field(default=3.0, description="T, 1.5 or 3")
    strength: Strength = Field(default="usual", description="of all effects that `effects` does not name")
    effects: dict[ImageEffect, Strength] = Field(default={}, description="strength of single effects")

    @field_validator("field")
    @classmethod
    def _known(cls, value: float) -> float:
        if value not in (1.5, 3.0):
            raise ValueError("relaxation times are known at 1.5 and at 3 T")
        return value


class Limb(Model):
    """Where the real images of a generated subject are, their unit, and the strokes on the neutral one."""

    unit: float = Field(gt=0, le=1000, description="mm a unit of lengths in the volumes' headers")
    shrunk: float = Field(
        default=1.0,
        gt=0,
        le=100,
        description="the limb is built so many times smaller: lengths in the pipeline are a hand's",
    )
    volumes: dict[Name, Path] = Field(description="file of each pose in `anatomy`")
    strokes: Path = Field(
        description="JSON of the strokes on the neutral volume, as polylines of voxels of the file"
    )
