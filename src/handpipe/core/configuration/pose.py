"""What was acquired in one pose."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from handpipe.core.configuration.model import Model, Name


class Role(StrEnum):
    """What a pose is for: the neutral pose, an example to fit to, or a pose held out for evaluation."""

    neutral = "neutral"
    example = "example"
    heldout = "heldout"


class Echo(Model):
    """One gradient echo of a Dixon acquisition."""

    time_ms: float = Field(gt=0, lt=100, description="echo time in ms")
    magnitude: Path = Field(description="magnitude, on the grid of `volume`; any format of `volume`")
    phase: Path | None = Field(
        None, description="phase in radians, degrees or the scanner's whole numbers; needed"
    )


class Dixon(Model):
    """Gradient echoes of one pose from which fat and water are separated."""

    echoes: tuple[Echo, ...] = Field(min_length=2, description="in the order of their times")
    field_T: float = Field(ge=0.2, le=12, description="field strength of the scanner in T")

    @model_validator(mode="after")
    def _separable(self) -> Dixon:
        times = [echo.time_ms for echo in self.echoes]
        if any(later <= earlier for earlier, later in zip(times, times[1:], strict=False)):
            raise ValueError("echoes: time_ms has to increase from echo to echo")
        if any(echo.phase is None for echo in self.echoes):
            raise ValueError(
                "echoes: without phase nobody can tell fat from water: a voxel of fat is as bright as one of "
                "water; give the phase of every echo"
            )
        return self


class Pose(Model):
    """What was acquired in one pose. Paths are relative to the dataset's root."""

    role: Role
    volume: Path = Field(description="MRI volume: NIfTI, NRRD, MetaImage, or a folder of DICOM images")
    series: int | str | None = Field(
        None, description="of a folder with several DICOM series: its number, description or UID"
    )
    echo: int | None = Field(
        None, ge=1, description="of a DICOM series with several echoes: 1 is the one of the shortest time"
    )
    channels: dict[Name, Path] = Field(
        {}, description="further volumes of the same pose on the grid of `volume`, by name, e.g. fat"
    )
    dixon: Dixon | None = Field(
        None, description="gradient echoes with phase: fat and water are separated from them"
    )
    seeds: Path | None = Field(
        None,
        description="seeds: label volume on the grid of `volume`, 0 none, bone labels, 255 background; or a "
        "segmentation (.seg.nrrd) with segments named as the bones are, and `background`",
    )
    labels: Path | None = Field(
        None,
        description="a person's own label map in the frame of `volume`: its bones are not segmented, its "
        "muscles are fitted to it; .seg.nrrd by the segments' names, or a label volume",
    )
    labels_show: Literal["whole", "marrow"] = Field(
        "whole", description="what `labels` show of a bone: all of it with its cortex, or its marrow"
    )
    scan: Path | None = Field(
        None,
        description="skin scan: PLY, OBJ or STL in mm, in the frame that `scan_frame` tells; may have holes",
    )
    scan_frame: Literal["volume", "own"] = Field(
        "volume",
        description="frame of the scan: that of `volume`, or its own; from that it is aligned to the skin in "
        "`volume`",
    )
    scribbles: dict[Name, Path] = Field({}, description="extra seeds for one bone, same format as `seeds`")
    markers: dict[Name, Path] = Field(
        {}, description="hand-placed boundary markers of a muscle: 3D Slicer .mrk.json"
    )
    landmarks: dict[Name, Path] = Field(
        {}, description="landmarks of a muscle: .mrk.json, labels as in the template's"
    )
