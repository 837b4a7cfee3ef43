"""Axis hints, tendons' paths and nails of a template, carried onto the subject's neutral bones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import CarriedTemplate
from handpipe.skeleton.bones import read_surfaces
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    neutral: Path
    templates: Sequence[Path]


def carry_template(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """Axis hints, tendons' paths and nails of a template, carried onto the subject's neutral bones."""
    carried = CarriedTemplate.onto(dataset, read_surfaces(inputs.neutral, "whole"))
    carried.save(output, inputs.all())
