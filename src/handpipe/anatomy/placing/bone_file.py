"""The file of bones that are placed inside a skin: three kinds (Abdrashitov 2021 §3.1), each a few points."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import Field

from handpipe.core import InputError, write_text
from handpipe.core.configuration import Model, Name, Vector, load_yaml

HEADING = "# Bones, written by handpipe bones. docs/how-to/place-bones.md explains the fields.\n"
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class CylinderBone(Model):
    """A long bone: a template stretched from end to end."""

    kind: Literal["cylinder"]
    template: str = Field("rod", description="of the library")
    points: tuple[Vector, Vector] = Field(description="both ends, mm")
    radius: Positive | None = Field(None, description="largest, mm; by default as the template")


class CurveBone(Model):
    """Bones in a row, as vertebrae: copies of a template along a Catmull-Rom spline."""

    kind: Literal["curve"]
    template: str = Field("rod", description="of the library")
    points: tuple[Vector, ...] = Field(min_length=2, description="the spline goes through them, mm")
    radius: Positive | None = Field(None, description="largest, mm; by default as the template")
    count: int = Field(5, ge=1, le=200, description="copies, named NAME_1 and so on")


class ShapeBone(Model):
    """A bone of another shape: a template in its proportions."""

    kind: Literal["shape"]
    template: str = Field("rod", description="of the library")
    points: tuple[Vector, Vector] = Field(description="its middle, and the end of its long axis, mm")


PlacedBone = Annotated[CylinderBone | CurveBone | ShapeBone, Field(discriminator="kind")]


class BoneFile(Model):
    """Bones by name."""

    units: Literal["mm"] = "mm"
    bones: dict[Name, PlacedBone] = Field(default_factory=dict)


def load_bones(path: str | Path) -> BoneFile:
    """Read a file of bones.

    Parameters
    ----------
    path : path
        YAML file.

    Returns
    -------
    BoneFile
        Bones by name.

    Raises
    ------
    InputError
        For the first wrong field.
    """
    try:
        return load_yaml(path, BoneFile)
    except InputError as error:
        raise InputError(path, error.field, error.problem, "See docs/how-to/place-bones.md") from error


def write_bone_file(path: str | Path, file: BoneFile) -> None:
    """Write a file of bones, atomically; `load_bones` reads the same bones.

    Parameters
    ----------
    path : path
        File to be written.
    file : BoneFile
        Bones by name. Fields that were not given are not written.
    """
    content = file.model_dump(mode="json", exclude_unset=True)
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
    write_text(path, HEADING + text)
