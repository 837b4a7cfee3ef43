"""Layers from their artifacts, as their records say."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from importlib import import_module
from pathlib import Path

from handpipe.core import LAYERS, Layer, made
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface


def load_layers(
    names: Iterable[str],
    dataset: Dataset,
    files: Iterable[Path],
    bones: Mapping[str, Surface],
    roles: Collection[str] | None = None,
) -> list[Layer]:
    """Layers by name, inside out, without those that the subject lacks.

    Parameters
    ----------
    names : iterable of str
        Names of the layers.
    dataset : Dataset
        The subject, which says what it lacks.
    files : iterable of Path
        The artifacts of the layers, as `handpipe.core.artifacts_of` lists them.
    bones : mapping of str to Surface
        The bones' neutral surfaces in mm.
    roles : collection of str, optional
        Roles (of `LayerRecord`) of the layers that are loaded, by default all; files of others are not read.

    Returns
    -------
    list of Layer
        Layers that can be solved.

    Raises
    ------
    InputError
        For an artifact that is missing or of another kind.
    ValueError
        Where there are more or fewer files than artifacts.
    """
    own: dict[str, list[Path]] = {name: [] for name in made(names, dataset)}
    owners = [name for name in own for _ in LAYERS[name].files(dataset)]
    for name, file in zip(owners, files, strict=True):
        own[name].append(file)
    chosen = [name for name in own if roles is None or LAYERS[name].role in roles]
    return [load_layer(name, own[name], bones) for name in chosen]


def load_layer(name: str, files: Sequence[Path], bones: Mapping[str, Surface]) -> Layer:
    """One layer from its artifacts; parameters as in `load_layers`."""
    module, _, function = LAYERS[name].load.partition(":")
    layer: Layer = getattr(import_module(module), function)(files, bones)
    return layer
