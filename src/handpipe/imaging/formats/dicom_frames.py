"""What DICOM headers say of each image of a folder: which series, which echo, where it lies."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from pydicom.errors import InvalidDicomError

from handpipe.core import Array, InputError
from handpipe.imaging.formats.stored import reading, require_size

log = logging.getLogger(__name__)

SUFFIXES = (".dcm", ".dicom", ".ima")
LONG = 2**12  # bytes
COMPONENTS = {  # of a complex image, as ImageType or ComplexImageComponent name them
    "P": "phase",
    "PHASE": "phase",
    "PHASE MAP": "phase",
    "R": "real",
    "REAL": "real",
    "I": "imaginary",
    "IMAGINARY": "imaginary",
}


@dataclass(frozen=True)
class DicomFrame:
    """What a DICOM header says of one 2D image.

    Parameters
    ----------
    file : Path
        File of the image.
    number : int
        Number of the image in its file, from 0.
    uid, series_uid, series_number, description : str
        Identifiers of the image and of its series, and the series' description.
    size : tuple of 2 ints
        Number of rows and of columns.
    spacing : array (2,)
        Distances between rows and between columns in mm.
    orientation : array (2, 3)
        Unit directions along a row and along a column, in LPS.
    position : array (3,) or None
        Centre of the first pixel in mm, LPS; None where the header lacks it.
    echo_time : float or None
        Echo time in ms.
    slope, intercept : float
        Of the rescaling to the scanner's values.
    component : str
        "phase", "real" or "imaginary" part of a complex image, else empty.
    mosaic : bool
        Whether the image is a mosaic of slices.
    photometric : str
        Photometric interpretation.
    reference : str
        UID of the frame of reference.
    """

    file: Path
    number: int
    uid: str
    series_uid: str
    series_number: str
    description: str
    size: tuple[int, int]
    spacing: Array
    orientation: Array
    position: Array | None
    echo_time: float | None
    slope: float
    intercept: float
    component: str
    mosaic: bool
    photometric: str
    reference: str

    @property
    def series(self) -> str:
        """As a message names it."""
        return f"{self.series_number} ({self.description})" if self.description else self.series_number


def frames_of(path: Path) -> list[DicomFrame]:
    """Every image in a DICOM file or in all files under a folder.

    Parameters
    ----------
    path : Path
        File or folder. Files of other formats are skipped.

    Returns
    -------
    list of DicomFrame
        Images with what their headers say.

    Raises
    ------
    InputError
        If a DICOM file is damaged.
    """
    files = [path] if path.is_file() else sorted(f for f in path.rglob("*") if f.is_file())
    found: list[DicomFrame] = []
    foreign = []
    for file in files:
        with reading(file, "DICOM"):
            header = _header(file)
            if header is None:
                foreign.append(file.name)
            elif _is_image(file, header):
                found += _frames(file, header)
    if foreign and path.is_dir():
        log.warning("%s: passed over %d files that are not DICOM: %s", path, len(foreign), ", ".join(foreign))
    return found


def is_dicom(path: Path) -> bool:
    """Whether a file begins as DICOM files do."""
    with reading(path, "DICOM"), open(path, "rb") as file:
        return file.read(132)[128:] == b"DICM"


def _header(file: Path) -> pydicom.Dataset | None:
    """All elements, long ones unread; None of a file that is not DICOM."""
    if file.name.startswith("."):
        return None
    try:
        return pydicom.dcmread(file, defer_size=LONG)
    except InvalidDicomError:
        if file.suffix.lower() in SUFFIXES or file.stat().st_size == 0:
            raise
        return None


def _is_image(file: Path, header: pydicom.Dataset) -> bool:
    """Whether there are pixels, other than in a directory, a report or a presentation state."""
    if "Rows" in header and "Columns" in header:
        return True
    kind = header.file_meta.get("MediaStorageSOPClassUID", None) or header.get("SOPClassUID", None)
    if kind is None or "Image Storage" in kind.name:
        raise InputError(file, "content", "is truncated or damaged: it has no size", "Copy it again")
    return False


def _frames(file: Path, header: pydicom.Dataset) -> Iterator[DicomFrame]:
    count = int(header.get("NumberOfFrames", None) or 1)
    _require_pixels(file, header, count)
    shared = _first(header, "SharedFunctionalGroupsSequence")
    own = header.get("PerFrameFunctionalGroupsSequence", None)
    if count > 1 and own is None:
        problem = f"holds {count} frames without a place for each"
        raise InputError(file, "frames", problem, "Export it as one image a file, or as enhanced MR")
    if own is not None and len(own) != count:
        raise InputError(file, "frames", f"{len(own)} are described, {count} are there", "Export it again")
    for number in range(count):
        sources = [header] if own is None else [own[number], shared, header]
        yield _frame(file, number, header, [s for s in sources if s is not None])


def _require_pixels(file: Path, header: pydicom.Dataset, count: int) -> None:
    """Raise `InputError` where the pixels are missing or more are declared than the file can hold."""
    if "PixelData" not in header:  # a wrong length before them ends the list of elements, too
        raise InputError(file, "pixels", "are missing: the file is truncated or damaged", "Copy it again")
    pixels = int(header.Rows) * int(header.Columns) * count * int(header.get("SamplesPerPixel", 1))
    compressed = header.file_meta.TransferSyntaxUID.is_encapsulated
    deflated = header.file_meta.TransferSyntaxUID.is_deflated
    bits = int(header.get("BitsAllocated", 8))
    ratio = np.inf if compressed or deflated else 1
    require_size(file, pixels, max(bits // 8, 1), file.stat().st_size, ratio)


def _frame(file: Path, number: int, header: pydicom.Dataset, sources: list[Any]) -> DicomFrame:
    position = _of(sources, "PlanePositionSequence", "ImagePositionPatient")
    orientation = _of(sources, "PlaneOrientationSequence", "ImageOrientationPatient")
    spacing = _of(sources, "PixelMeasuresSequence", "PixelSpacing")
    if spacing is None:  # images that were converted, not acquired, name it otherwise
        spacing = header.get("NominalScannedPixelSpacing", None) or header.get("ImagerPixelSpacing", None)
    echo = _of(sources, "MREchoSequence", "EffectiveEchoTime")
    echo = header.get("EchoTime", None) if echo is None else echo
    kinds = _of(sources, "MRImageFrameTypeSequence", "FrameType") or header.get("ImageType", None) or []
    whole = _of(sources, "MRImageFrameTypeSequence", "ComplexImageComponent")
    named = [str(kind).upper() for kind in [*list(kinds)[2:], whole]]
    transformation = "PixelValueTransformationSequence"
    known = position is not None and orientation is not None and spacing is not None
    return DicomFrame(
        file=file,
        number=number,
        uid=str(header.get("SOPInstanceUID", "")),
        series_uid=str(header.get("SeriesInstanceUID", "")),
        series_number=str(header.get("SeriesNumber", None) or "without number"),
        description=str(header.get("SeriesDescription", "")).strip(),
        size=(int(header.Rows), int(header.Columns)),
        spacing=np.array(spacing if known else (np.nan, np.nan), float),
        orientation=np.array(orientation if known else (np.nan,) * 6, float).reshape(2, 3),
        position=np.array(position, float) if known else None,
        echo_time=None if echo is None else float(echo),
        slope=float(_of(sources, transformation, "RescaleSlope") or 1),
        intercept=float(_of(sources, transformation, "RescaleIntercept") or 0),
        component=next((COMPONENTS[kind] for kind in named if kind in COMPONENTS), ""),
        mosaic="MOSAIC" in named,
        photometric=str(header.get("PhotometricInterpretation", "")),
        reference=str(header.get("FrameOfReferenceUID", "")),
    )


def _of(sources: list[Any], sequence: str, field: str) -> Any:
    """A field of a frame: in its own functional group, else in the shared one, else in the header itself."""
    for source in sources:
        group = _first(source, sequence)
        for place in (group, source):
            value = None if place is None else place.get(field, None)
            if value is not None and value != "":
                return value
    return None


def _first(dataset: Any, sequence: str) -> Any:
    items = dataset.get(sequence, None)
    return items[0] if items else None
