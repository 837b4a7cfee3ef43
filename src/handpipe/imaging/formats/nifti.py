"""NIfTI-1 and NIfTI-2 in one file, plain or gzipped."""

from __future__ import annotations

import gzip
from math import prod
from pathlib import Path
from typing import Any

import nibabel
import numpy as np

from handpipe.core import Array, InputError
from handpipe.imaging.formats.stored import (
    DEFLATE,
    EXPORT,
    Stored,
    reading,
    require_scalar,
    require_size,
    spatial_shape,
)

UNITS = {"mm": 1.0, "unknown": 1.0, "meter": 1000.0, "micron": 0.001}
BLOCK = 2**20  # bytes read at a time; what may follow the voxels
AGREEMENT = 0.1  # voxels: how far sform and qform may place a voxel apart


def read_nifti(path: Path) -> Stored:
    """Read a NIfTI file, scaled by its slope and intercept.

    Parameters
    ----------
    path : Path
        File, .nii or .nii.gz.

    Returns
    -------
    Stored
        Values and affine.

    Raises
    ------
    InputError
        If the file is damaged, holds colours, complex numbers or several volumes, is too short for its size,
        or its header does not say where the voxels lie.
    """
    with reading(path, "NIfTI"):
        image: Any = nibabel.load(path)
    if not isinstance(image, nibabel.Nifti1Image):
        problem = f"is {type(image).__name__}, not NIfTI in one file"
        raise InputError(path, "content", problem, "Save it as .nii.gz")
    dtype = image.get_data_dtype()
    require_scalar(path, dtype)
    shape = spatial_shape(path, image.shape)
    compressed = path.name.lower().endswith(".gz")
    require_size(path, prod(shape), dtype.itemsize, path.stat().st_size, ratio=DEFLATE if compressed else 1)
    affine = _affine(path, image.header, shape)
    proxy: Any = image.dataobj
    if compressed:
        _require_sound(path, int(proxy.offset) + prod(shape) * dtype.itemsize)
    with reading(path, "NIfTI"):
        values = np.asanyarray(proxy).reshape(shape)
    return Stored(values, affine)


def _require_sound(path: Path, declared: int) -> None:
    """Raise `InputError` where a gzipped file is damaged: its checksum is the end of the stream."""
    inflated = 0
    with reading(path, "NIfTI"), gzip.open(path) as stream:
        while inflated <= declared + BLOCK and (block := stream.read(BLOCK)):
            inflated += len(block)
    if not declared <= inflated <= declared + BLOCK:
        size = "more" if inflated > declared else f"{inflated:,}"
        problem = f"the header declares {declared:,} bytes, the file holds {size}"
        raise InputError(path, "size", problem, EXPORT)


def _affine(path: Path, header: Any, shape: tuple[int, int, int]) -> Array:
    """From indices to RAS mm, of the sform, else of the qform."""
    with reading(path, "NIfTI"):
        stated = {name: getattr(header, f"get_{name}")(coded=True)[0] for name in ("sform", "qform")}
        unit = header.get_xyzt_units()[0]
    sform, qform = stated["sform"], stated["qform"]
    if sform is None and qform is None:
        problem = "neither sform nor qform is set, so left and right are unknown"
        raise InputError(path, "orientation", problem, "Export it again with its orientation")
    if sform is not None and qform is not None:
        _require_agreement(path, sform, qform, shape)
    affine = np.array(qform if sform is None else sform, np.float64)
    affine[:3] *= UNITS[unit]
    return affine


def _require_agreement(path: Path, sform: Array, qform: Array, shape: tuple[int, int, int]) -> None:
    """Programs differ in which of the two they read, so both have to place the voxels alike."""
    corners = np.array(np.meshgrid(*((0, n - 1) for n in shape))).reshape(3, -1)
    apart = np.linalg.norm((sform - qform)[:3, :3] @ corners + (sform - qform)[:3, 3:], axis=0).max()
    if not apart <= AGREEMENT * np.linalg.norm(sform[:3, :3], axis=0).min():
        problem = f"sform and qform place voxels up to {apart:.3g} mm apart"
        raise InputError(path, "orientation", problem, "Export it again with one orientation")
