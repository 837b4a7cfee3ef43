"""MetaImage: .mha, and .mhd with its voxels beside it."""

from __future__ import annotations

import os
import zlib
from math import prod
from pathlib import Path

import numpy as np
import SimpleITK as sitk

from handpipe.core import Array, InputError
from handpipe.imaging.formats.stored import (
    DEFLATE,
    EXPORT,
    LPS_TO_RAS,
    Stored,
    reading,
    require_scalar,
    require_size,
    spatial_shape,
)

LONGEST_LINE = 2**16  # bytes
DIRECTIONS = ("TransformMatrix", "Rotation", "Orientation")  # names of the same field
BYTES = {"CHAR": 1, "SHORT": 2, "INT": 4, "LONG": 4, "LONG_LONG": 8, "FLOAT": 4, "DOUBLE": 8}


def read_meta_image(path: Path) -> Stored:
    """Read a MetaImage, whose world is LPS.

    Parameters
    ----------
    path : Path
        File, .mha or .mhd.

    Returns
    -------
    Stored
        Values and affine.

    Raises
    ------
    InputError
        If the file is damaged, holds colours or several volumes, is too short for its size, or its header
        lacks directions or spacing.
    """
    header, length = _header(path)
    _require_geometry(path, header)
    with reading(path, "MetaImage"):
        require_scalar(path, np.dtype(float), int(header.get("ElementNumberOfChannels", "1")))
        sizes = [int(n) for n in header["DimSize"].split()]
        kind = header["ElementType"].removeprefix("MET_").removesuffix("_ARRAY")
        itemsize = BYTES[kind if kind in BYTES else kind.removeprefix("U")]
    shape = spatial_shape(path, sizes)
    compressed = header.get("CompressedData", "False").lower() == "true"
    require_size(path, prod(shape), itemsize, _stored(path, header, length), DEFLATE if compressed else 1)
    if compressed:
        _require_sound(path, header, length, prod(shape) * itemsize)
    with reading(path, "MetaImage"):
        image = sitk.ReadImage(str(path), imageIO="MetaImageIO")
        values = sitk.GetArrayFromImage(image).T.reshape(shape)
    return Stored(values, LPS_TO_RAS @ _affine(image))


def _header(path: Path) -> tuple[dict[str, str], int]:
    """The fields up to ElementDataFile, which is the last, and the header's bytes."""
    found, length = {}, 0
    with reading(path, "MetaImage"), open(path, "rb") as file:
        while line := file.readline(LONGEST_LINE):
            length += len(line)
            key, equals, value = (part.strip() for part in os.fsdecode(line).partition("="))
            if not equals:
                break
            found[key] = value
            if key == "ElementDataFile":
                return found, length
    raise InputError(path, "content", "cannot be read as MetaImage (no ElementDataFile)", EXPORT)


def _require_geometry(path: Path, header: dict[str, str]) -> None:
    if not any(name in header for name in DIRECTIONS):
        raise InputError(path, "space", "TransformMatrix is missing", "Export it again with its orientation")
    with reading(path, "MetaImage"):
        spacing = np.array(header.get("ElementSpacing", "nan").split(), float)
    if not (spacing > 0).all():
        stated = header.get("ElementSpacing", "missing")
        raise InputError(path, "spacing", f"ElementSpacing is {stated}", "Write positive sizes in mm")


def _stored(path: Path, header: dict[str, str], length: int) -> int:
    """Bytes that hold the voxels, in this file or in the one that it names."""
    named = header["ElementDataFile"]
    if named.upper() == "LOCAL":
        return path.stat().st_size - length
    data = path.parent / named
    if not data.is_file():
        problem = f"{named} is not beside the header"
        raise InputError(path, "ElementDataFile", problem, "Put both into one folder, or save it as .mha")
    return data.stat().st_size


def _require_sound(path: Path, header: dict[str, str], length: int, declared: int) -> None:
    """Raise `InputError` for a damaged or short stream, which ITK would read without a word."""
    named = header["ElementDataFile"]
    local = named.upper() == "LOCAL"
    with reading(path, "MetaImage"), open(path if local else path.parent / named, "rb") as file:
        file.seek(length if local else 0)
        stream = zlib.decompressobj(zlib.MAX_WBITS | 32)  # zlib or gzip
        inflated = len(stream.decompress(file.read(), declared + 1))
    if inflated != declared or not stream.eof:
        problem = f"cannot be read as MetaImage ({inflated:,} of {declared:,} bytes of voxels are sound)"
        raise InputError(path, "content", problem, EXPORT)


def _affine(image: sitk.Image) -> Array:
    axes = image.GetDimension()
    affine = np.eye(4)
    directions = np.reshape(image.GetDirection(), (axes, axes))[:3, :3]
    affine[:3, :3] = directions * np.array(image.GetSpacing()[:3])
    affine[:3, 3] = image.GetOrigin()[:3]
    return affine
