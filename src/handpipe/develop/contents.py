"""What a file of a results folder holds, as named arrays, without times, memory and provenance."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import meshio
import nibabel as nib
import numpy as np
from numpy.typing import NDArray

Contents = dict[str, NDArray[Any]]

MACHINE_UNITS = ("s", "GiB")  # metrics in these units measure the machine
MACHINE_FOLDERS = ("logs", "benchmarks")
MACHINE_SUFFIXES = (".html", ".tsv")  # the report shows times, the benchmark files are times


def is_compared(path: Path) -> bool:
    """Whether a file, given below its results folder, holds results rather than times and logs."""
    hidden = any(part.startswith(".") for part in path.parts)
    return not (hidden or set(path.parts) & set(MACHINE_FOLDERS) or path.suffix in MACHINE_SUFFIXES)


def contents(path: Path) -> Contents:
    """Arrays of a file by name; the bytes of a file whose format is not known."""
    for ending, read in READERS.items():
        if path.name.endswith(ending):
            return read(path)
    return {"bytes": np.frombuffer(path.read_bytes(), dtype=np.uint8)}


def _hdf5(path: Path) -> Contents:
    found: Contents = {}

    def keep(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            text = h5py.check_string_dtype(item.dtype)
            found[name] = np.asarray(item.asstr()[()] if text else item[()])

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return found


def _json(path: Path) -> Contents:
    return dict(_leaves(json.loads(path.read_text(encoding="utf-8")), ""))


def _leaves(value: Any, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Numbers, texts and empty containers of a JSON value, except for seconds and memory."""
    if isinstance(value, dict) and value.get("unit") in MACHINE_UNITS:
        return
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if not items:
        yield name, np.array("null" if value is None else value if np.isscalar(value) else str(value))
    for key, inner in items:
        yield from _leaves(inner, f"{name}/{key}" if name else str(key))


def _nifti(path: Path) -> Contents:
    image = nib.load(path)
    assert isinstance(image, nib.spatialimages.SpatialImage)
    return {"voxels": np.asarray(image.dataobj), "affine": np.asarray(image.affine)}


def _mesh(path: Path) -> Contents:
    mesh = meshio.read(path)
    found: Contents = {"points": mesh.points}
    found |= {f"cells/{i}/{block.type}": block.data for i, block in enumerate(mesh.cells)}
    found |= {f"point_data/{name}": np.asarray(data) for name, data in mesh.point_data.items()}
    for name, blocks in mesh.cell_data.items():
        found |= {f"cell_data/{name}/{i}": np.asarray(data) for i, data in enumerate(blocks)}
    return found


def _gzip(path: Path) -> Contents:
    with gzip.open(path) as file:
        return {"bytes": np.frombuffer(file.read(), dtype=np.uint8)}


READERS: dict[str, Callable[[Path], Contents]] = {
    **dict.fromkeys((".h5", ".nc"), _hdf5),
    **dict.fromkeys((".nii.gz", ".nii"), _nifti),
    **dict.fromkeys((".ply", ".vtu", ".obj", ".stl"), _mesh),
    ".json": _json,
    ".gz": _gzip,
}
