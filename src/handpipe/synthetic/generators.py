"""Generators of datasets by name. Each makes one pose, or what belongs to no pose, at a time."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol, cast

from handpipe.core import InputError
from handpipe.core.configuration import Dataset

MODULES = {
    "phantom-finger": "phantom.phantom_finger",
    "zanatomy-index": "real_anatomy.zanatomy_index",
    "phantom-hand": "phantom.phantom_hand",
    "myohand-bones": "real_anatomy.myohand_bones",
    "zanatomy-bones": "real_anatomy.zanatomy_bones",
}


class Generator(Protocol):
    """Interface of a generator's module: files of one pose, or of the templates."""

    def generate_pose(self, dataset: Dataset, pose: str) -> None:
        """Write a pose's volume, seeds, scan, truth and label volumes where the dataset names them.

        Raises
        ------
        InputError
            For an unknown pose, or where the source data are absent.
        """

    def generate_templates(self, dataset: Dataset) -> None:
        """Write the templates, attachments, tendon curves and nail patches that the dataset names."""


def generator_of(dataset: Dataset) -> Generator:
    """The generator that the dataset names; `InputError` if it names none."""
    if dataset.generator is None:
        raise InputError(
            dataset.name, "generator", "is not given", "Only generated datasets can be generated"
        )
    return cast(Generator, import_module(f"handpipe.synthetic.{MODULES[dataset.generator]}"))
