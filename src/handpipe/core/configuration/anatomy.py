"""The bones, joints, muscles, tendons and nails that a dataset names."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from handpipe.core.configuration.model import Model, Name, Vector


class Bone(Model):
    """A bone's label in volumes and, where muscle templates are placed, its template surface."""

    label: int = Field(ge=1, le=254, description="its value in seed and label volumes")
    template: Path | None = Field(
        None, description="surface of the same bone in the frame of the muscle templates"
    )


class Joint(Model):
    """A joint carries `child` on `parent`; its angles are named, e.g. MP2_flexion."""

    parent: Name
    child: Name
    angles: tuple[Name, ...] = Field(
        max_length=3, description="one name a degree of freedom; none where both bones move as one"
    )
    type: Literal["saddle", "best"] | None = Field(
        None,
        description="of two angles: axes at any angle and distance (saddle), or what left-out poses favour "
        "(best); by default two orthogonal axes through one centre",
    )
    limits_deg: tuple[tuple[float, float], ...] | None = Field(
        None,
        description="[lower, upper] of each angle; by default what poses show, widened by published ranges",
    )
    axis_hints: tuple[Vector, ...] = Field(
        description="rough axis of each angle in the neutral frame: fixes its sign"
    )

    @model_validator(mode="after")
    def _lengths(self) -> Joint:
        limits = self.angles if self.limits_deg is None else self.limits_deg
        if not len(self.angles) == len(limits) == len(self.axis_hints):
            raise ValueError("angles, limits_deg and axis_hints need the same length")
        if self.type is not None and len(self.angles) != 2:
            raise ValueError(f"type: {self.type} is for joints of two angles")
        for lower, upper in self.limits_deg or ():
            if not -360 <= lower < upper <= 360:
                raise ValueError(f"limits_deg: [{lower:g}, {upper:g}] is no range of degrees")
        if any(sum(c * c for c in axis) < 1e-12 for axis in self.axis_hints):
            raise ValueError("axis_hints: an axis of zero length has no direction")
        return self


class Muscle(Model):
    """A template surface and where it attaches: `attachments` is JSON {bone: [template vertex ids]}."""

    template: Path
    attachments: Path
    landmarks: Path | None = Field(None, description="landmarks on the template: .mrk.json")


class Tendon(Model):
    """`path` is a .mrk.json curve of a few points along it in neutral, from its insertion outwards."""

    bones: tuple[Name, ...] = Field(
        min_length=1,
        description="bones that it passes, from that of its insertion outwards; they drive its hooks",
    )
    path: Path
    radius: float = Field(gt=0, le=20, description="rough radius in mm")

    @model_validator(mode="before")
    @classmethod
    def _no_bone(cls, given: Any) -> Any:
        if isinstance(given, dict) and "bone" in given:
            raise ValueError(
                "bone: is no field any more; remove it, the tendon inserts at the first of `bones`"
            )
        return given


class Nail(Model):
    """A nail: the bone that it moves with, and its patch of the skin."""

    bone: Name
    surface: Path = Field(description="the nail's patch of the neutral skin, an open surface in mm")
