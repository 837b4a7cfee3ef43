"""Layers from their artifacts, as their records say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path

from handpipe.config import Dataset
from handpipe.layer_registry import LAYERS, made
from handpipe.layers import Layer
from handpipe.mesh.surface import Surface


def load_layers(
    names: Iterable[str], dataset: Dataset, folder: str | Path, bones: Mapping[str, Surface]
) -> list[Layer]:
    """Layers by name, inside out, without those that the subject lacks.

    Parameters
    ----------
    folder : path
        The subject's folder of results.
    bones : mapping of str to Surface
        The bones' neutral surfaces in mm.

    Raises
    ------
    InputError
        For an artifact that is missing or of another kind.
    """
    return [load_layer(name, dataset, folder, bones) for name in made(names, dataset)]


def load_layer(name: str, dataset: Dataset, folder: str | Path, bones: Mapping[str, Surface]) -> Layer:
    """One layer; parameters as `load_layers`."""
    record = LAYERS[name]
    module, _, function = record.load.partition(":")
    files = [Path(folder) / path for path in record.files(dataset)]
    layer: Layer = getattr(import_module(module), function)(files, bones)
    return layer
