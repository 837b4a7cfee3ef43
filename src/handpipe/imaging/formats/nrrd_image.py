"""NRRD with attached or detached voxels: plain volumes, and the layers of a segmentation."""

from __future__ import annotations

import bz2
import gzip
import io
from math import prod
from pathlib import Path
from typing import Any

import nrrd
import numpy as np
from numpy.typing import NDArray

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

Header = dict[str, Any]
AXES = (("left", "right"), ("posterior", "anterior"), ("inferior", "superior"))
INITIALS = {name[0]: name for ends in AXES for name in ends}
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3, "μm": 1e-3, "in": 25.4}
COMPRESSED = {"gzip": gzip.open, "gz": gzip.open, "bzip2": bz2.open, "bz2": bz2.open}
BYTES_OF_TEXT = 2  # the least that a number takes, with the blank after it


def read_nrrd(path: Path) -> Stored:
    """Read a scalar volume of NRRD.

    Parameters
    ----------
    path : Path
        File, .nrrd or .nhdr.

    Returns
    -------
    Stored
        Values and affine.

    Raises
    ------
    InputError
        If the file is damaged, holds colours, vectors or several volumes, is too short for its size, or its
        space is not made of left-right, posterior-anterior and inferior-superior.
    """
    header = read_header(path)
    spatial, layers = spatial_axes(path, header)
    sizes = [int(n) for n in header["sizes"]]
    if layers:
        require_scalar(path, np.dtype(float), prod(sizes[a] for a in layers))
    shape = spatial_shape(path, [sizes[a] for a in spatial])
    affine = grid(path, header, spatial)
    values = read_values(path, header)
    return Stored(np.moveaxis(values, spatial, (0, 1, 2)).reshape(shape), affine)


def read_header(path: Path) -> Header:
    """The fields and key/value pairs of a header, its sizes checked against the file."""
    with reading(path, "NRRD"):
        header: Header = dict(nrrd.read_header(str(path)))
        sizes, encoding = [int(n) for n in header["sizes"]], str(header["encoding"]).lower()
        file = _data_file(path, header)
        stored = file.stat().st_size
    if min(sizes, default=0) < 1:
        raise InputError(path, "sizes", f"are {sizes}", "Export it again")
    ratio = DEFLATE if encoding in ("gzip", "gz") else np.inf if encoding in COMPRESSED else 1
    itemsize = BYTES_OF_TEXT if encoding in ("text", "txt", "ascii") else 1
    require_size(path, prod(sizes), itemsize, stored + 1, ratio)
    return header


def spatial_axes(path: Path, header: Header) -> tuple[list[int], list[int]]:
    """Axes that have a direction in space, and those that have none."""
    if "space directions" not in header:
        problem = "space directions are missing"
        raise InputError(path, "space", problem, "Save it with directions, in LPS or RAS space")
    with reading(path, "NRRD"):
        directions = np.asarray(header["space directions"], float)
        known = np.isfinite(directions).all(axis=1)
    if directions.shape != (len(header["sizes"]), 3) or known.sum() < 3:
        problem = f"directions are given for {known.sum()} axes of {len(header['sizes'])}"
        raise InputError(path, "space", problem, "Give one scalar 3D volume with three directions")
    axes = np.arange(len(known))
    return axes[known].tolist(), axes[~known].tolist()


def grid(path: Path, header: Header, spatial: list[int]) -> Array:
    """From indices along the spatial axes to RAS mm."""
    affine = np.eye(4)
    with reading(path, "NRRD"):
        affine[:3, :3] = np.asarray(header["space directions"], float)[spatial].T
        affine[:3, 3] = header.get("space origin", np.zeros(3))
    if len(spatial) > 3:
        raise InputError(path, "shape", "has four axes in space", "Give one scalar 3D volume")
    affine[:3] *= _unit(path, header)
    return _to_ras(path, str(header.get("space", "missing"))) @ affine


def _to_ras(path: Path, space: str) -> Array:
    """Signs from a space such as left-posterior-superior or LPS to RAS."""
    names = space.lower().split("-")
    if len(names) == 1:
        names = [INITIALS.get(letter, "") for letter in names[0]]
    if len(names) != 3 or any(n not in ends for n, ends in zip(names, AXES, strict=True)):
        raise InputError(path, "space", f"is {space!r}", "Save it in LPS or RAS space")
    return np.diag([*(1.0 if n == end else -1.0 for n, (_, end) in zip(names, AXES, strict=True)), 1.0])


def _unit(path: Path, header: Header) -> float:
    units = {str(u).strip('" ') for u in header.get("space units", [])} - {""}
    if len(units) > 1 or units - set(MILLIMETRES):
        raise InputError(path, "units", f"the header says {sorted(units)}", "Write voxel sizes in mm")
    return MILLIMETRES[units.pop()] if units else 1.0


def read_values(path: Path, header: Header) -> NDArray:
    """Voxels in the header's axes; what a compressed stream may inflate to is bounded by the header."""
    with reading(path, "NRRD"), open(_data_file(path, header), "rb") as file:
        if _data_file(path, header) == path:
            nrrd.read_header(file)  # leaves the file at its voxels
        encoding = str(header["encoding"]).lower()
        attached = {k: v for k, v in header.items() if k not in ("data file", "datafile")}
        if encoding not in COMPRESSED:
            return nrrd.read_data(attached, file)
        for _ in range(_skip(header, "line")):
            file.readline()
        skipped = max(_skip(header, "byte"), 0)
        limit = skipped + 8 * prod(int(n) for n in header["sizes"])  # no scalar has more than 8 bytes
        with COMPRESSED[encoding](file) as stream:  # type: ignore[operator]
            inflated = stream.read(limit + 1)
        plain = {k: v for k, v in attached.items() if k not in ("line skip", "lineskip")}
        values = nrrd.read_data(plain | {"encoding": "raw"}, io.BytesIO(inflated))
        if len(inflated) > skipped + values.nbytes:
            raise InputError(path, "sizes", "the file holds more voxels than they say", EXPORT)
        return values


def _skip(header: Header, what: str) -> int:
    """How many lines or bytes lie before the voxels."""
    return int(header.get(f"{what} skip") or header.get(f"{what}skip") or 0)


def _data_file(path: Path, header: Header) -> Path:
    detached = header.get("data file", header.get("datafile"))
    return path if detached is None else path.parent / str(detached)
