"""DICOM files of a known image, as scanners and their exports write them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from numpy.typing import NDArray
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import UID, ExplicitVRLittleEndian

from handpipe.core import Array

MR, ENHANCED_MR = UID("1.2.840.10008.5.1.4.1.1.4"), UID("1.2.840.10008.5.1.4.1.1.4.1")
SERIES = "1.2.3.4"
LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
numbers: Iterator[int] = count(1)


def header(sop_class: UID, **fields: Any) -> FileDataset:
    """What all images have: identifiers and the pixels' format, overridden by `fields`."""
    uid = UID(f"1.2.3.9.{next(numbers)}")
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = sop_class, uid
    data = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = sop_class, uid
    data.StudyInstanceUID, data.SeriesInstanceUID, data.FrameOfReferenceUID = "1.2.3", SERIES, "1.2.5"
    data.Modality, data.SeriesNumber, data.SeriesDescription = "MR", 5, "t1"
    data.ImageType = ["ORIGINAL", "PRIMARY", "M", "ND"]
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 0
    for name, value in fields.items():
        setattr(data, name, value)
    return data


def places(affine: Array, slices: int) -> tuple[list[float], list[float], list[list[float]]]:
    """PixelSpacing, ImageOrientationPatient and each slice's ImagePositionPatient of a RAS affine."""
    lps = LPS_TO_RAS @ affine
    spacing = np.linalg.norm(lps[:3, :2], axis=0)
    directions = lps[:3, :2] / spacing
    positions = lps[:3, 3] + np.arange(slices)[:, None] * lps[:3, 2]
    return (
        [round(float(s), 9) for s in spacing[::-1]],
        [round(float(c), 9) for c in directions.T.ravel()],
        [[round(float(c), 6) for c in p] for p in positions],
    )


def slices(values: NDArray, affine: Array, **fields: Any) -> list[FileDataset]:
    """One classic image a slice of values (columns, rows, slices)."""
    spacing, orientation, positions = places(affine, values.shape[2])
    found = []
    for k, position in enumerate(positions):
        image = header(MR, InstanceNumber=k + 1, EchoTime=3.45)
        image.PixelSpacing, image.ImageOrientationPatient = spacing, orientation
        image.ImagePositionPatient = position
        put_pixels(image, values[:, :, k].T)
        for name, value in fields.items():
            setattr(image, name, value)
        found.append(image)
    return found


def put_pixels(image: FileDataset, pixels: NDArray) -> None:
    """Pixels (…, rows, columns) of 16 bits without sign."""
    image.Rows, image.Columns = pixels.shape[-2:]
    image.PixelData = pixels.astype("<u2").tobytes()


def enhanced(
    values: NDArray, affine: Array, order: NDArray | None = None, echoes: tuple[float, ...] = (3.45,)
) -> FileDataset:
    """One multi-frame image of values (columns, rows, slices) for each echo, frames in the given order.

    The values of a later echo are those of the first plus 1000.
    """
    spacing, orientation, positions = places(affine, values.shape[2])
    image = header(ENHANCED_MR)
    shared = Dataset()
    shared.PlaneOrientationSequence = Sequence([group(ImageOrientationPatient=orientation)])
    shared.PixelMeasuresSequence = Sequence([group(PixelSpacing=spacing, SliceThickness=1)])
    shared.PixelValueTransformationSequence = Sequence(
        [group(RescaleIntercept="-7", RescaleSlope="2", RescaleType="US")]
    )
    frames, stack = [], []
    for e, echo in enumerate(echoes):
        for k in np.arange(values.shape[2]) if order is None else order:
            frame = Dataset()
            frame.PlanePositionSequence = Sequence([group(ImagePositionPatient=positions[k])])
            frame.MREchoSequence = Sequence([group(EffectiveEchoTime=echo)])
            frames.append(frame)
            stack.append(values[:, :, k].T + 1000 * e)
    image.NumberOfFrames = len(frames)
    image.SharedFunctionalGroupsSequence = Sequence([shared])
    image.PerFrameFunctionalGroupsSequence = Sequence(frames)
    put_pixels(image, np.array(stack))
    return image


def group(**fields: Any) -> Dataset:
    """One item of a sequence."""
    item = Dataset()
    for name, value in fields.items():
        setattr(item, name, value)
    return item


def save(folder: Path, images: list[FileDataset], name: str = "IM{:04}.dcm") -> Path:
    """Write images into a folder under numbered names."""
    folder.mkdir(parents=True, exist_ok=True)
    begin = len(list(folder.iterdir()))
    for number, image in enumerate(images, begin):
        pydicom.dcmwrite(folder / name.format(number), image, enforce_file_format=True)
    return folder
