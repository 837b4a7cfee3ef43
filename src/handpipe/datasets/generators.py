"""The generators of subjects by name, imported only when asked for."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from handpipe.config import Dataset


def of(dataset: Dataset) -> ModuleType:
    """The module with `generate_pose(dataset, pose)` and `generate_templates(dataset)` for a dataset."""
    assert dataset.generator is not None, "only rules of generated subjects come here"
    return import_module("handpipe.datasets." + dataset.generator.replace("-", "_"))
