"""An image as its file stores it, and the checks that all formats share.

Files come from anywhere: a header is checked against the file's size before any voxel is read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np
import psutil
from numpy.typing import NDArray

from handpipe.core import Array, InputError

LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
LARGEST = 2**29  # voxels, 800 cubed; a hand at 0.25 mm has a tenth of them
DEFLATE = 1032  # the greatest ratio that deflate reaches
EXPORT = "Export it again"


@dataclass(frozen=True)
class Stored:
    """An image as its file stores it.

    Parameters
    ----------
    values : array (ni, nj, nk)
        Values in the order and type of the file.
    affine : array (4, 4)
        From indices of the values to RAS mm.
    """

    values: NDArray
    affine: Array


@contextmanager
def reading(path: str | Path, format: str) -> Iterator[None]:
    """Turn whatever a library raises on a damaged file into an `InputError`."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # libraries raise zlib.error, KeyError, struct.error, RuntimeError and more
        text = " ".join(str(error).split()).split("ITK ERROR: ")[-1] or type(error).__name__
        raise InputError(path, "content", f"cannot be read as {format} ({text})", EXPORT) from error


def spatial_shape(path: str | Path, shape: Sequence[int]) -> tuple[int, int, int]:
    """The first three sizes of an image whose further axes have one entry each.

    Parameters
    ----------
    path : str or Path
        File of the image, for messages.
    shape : sequence of int
        Sizes of all its axes.

    Returns
    -------
    tuple of 3 ints
        Sizes of the spatial axes.

    Raises
    ------
    InputError
        If the image is not one 3D volume.
    """
    sizes = tuple(int(n) for n in shape)
    if len(sizes) > 3 and max(sizes[3:]) > 1:
        remedy = "Save one of its volumes as a file of its own"
        raise InputError(path, "shape", f"is {sizes}: {prod(sizes[3:])} volumes, not one 3D volume", remedy)
    if len(sizes) < 3 or min(sizes) < 1 or min(sizes[:3]) < 2:
        raise InputError(path, "shape", f"is {sizes}, not a 3D volume", "Give one scalar 3D volume")
    return sizes[0], sizes[1], sizes[2]


def require_scalar(path: str | Path, dtype: np.dtype, components: int = 1) -> None:
    """Raise `InputError` for colours, vectors and complex numbers."""
    if dtype.names is not None or components > 1:
        count = components if dtype.names is None else len(dtype.names)
        problem = f"each voxel holds {count} values, as colours or vectors do"
        raise InputError(path, "values", problem, "Save one grey value a voxel")
    if dtype.kind == "c":
        raise InputError(path, "values", "are complex numbers", "Save their magnitude")


def require_size(path: str | Path, voxels: int, itemsize: int, stored: int, ratio: float = 1) -> None:
    """Raise `InputError` where a header declares more than its file or this machine can hold.

    Parameters
    ----------
    voxels, itemsize : int
        Declared by the header; itemsize in bytes.
    stored : int
        Bytes that hold the voxels in the file.
    ratio : float
        The greatest ratio of the file's compression.
    """
    declared = voxels * itemsize
    if declared > stored * ratio:
        problem = f"the header declares {declared:,} bytes of voxels, the file holds {stored:,} bytes"
        raise InputError(path, "size", f"{problem}: it is truncated or damaged", "Copy or " + EXPORT.lower())
    if voxels > LARGEST:
        problem = f"the header declares {voxels:,} voxels, more than {LARGEST:,}"
        raise InputError(path, "size", problem, "Crop it to the hand")
    needed, free = voxels * (itemsize + 8), psutil.virtual_memory().available
    if needed > free:
        problem = f"{voxels:,} voxels need {needed / 2**30:.1f} GiB; {free / 2**30:.1f} GiB are free"
        raise InputError(path, "size", problem, "Crop it to the hand, or use a machine with more memory")
