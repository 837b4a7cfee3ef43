"""DICOM series, enhanced images, and the choice of series and echo."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
import SimpleITK as sitk

from benchmarks.trust import dicom_files
from benchmarks.trust.dicom_files import save, slices
from benchmarks.trust.nifti_rows import save_nifti
from benchmarks.trust.volume_table import Table, bent, grey, oblique, stored_as


def dicom(table: Table) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    truth = (values, affine)
    table.right("DICOM", "one series", save(folder / "a", slices(values, affine)), truth)
    shuffled = np.random.default_rng(1).permutation(slices(values, affine)).tolist()
    table.right("DICOM", "files in any order", save(folder / "b", shuffled), truth)
    for codes in ("LPI", "PIR"):
        turned, turning = stored_as(codes, values, affine)
        table.right("DICOM", f"axes {codes}", save(folder / codes, slices(turned, turning)), truth)
    images = slices(values, affine)
    save(folder / "sub/1", images[:3])
    table.right("DICOM", "sub-folders", save(folder / "sub/2", images[3:]).parent, truth)
    junk = save(folder / "junk", slices(values, affine), "{:04}")
    for name in (".DS_Store", "DICOMDIR", "notes.txt", "._0001"):
        (junk / name).write_bytes(b"anything else" * 20)
    table.right("DICOM", "other files beside", junk, truth)
    scaled = slices(values, affine)
    for k, image in enumerate(scaled):
        image.RescaleSlope, image.RescaleIntercept = str(1 + k / 4), str(-k)
    expected = values * (1 + np.arange(7) / 4) - np.arange(7)
    table.right_truth("DICOM", "a slope for each slice", save(folder / "slopes", scaled), expected, affine)
    for compressor in ("JPEG2000", "JPEG"):
        path = recoded(save(folder / compressor, slices(values, affine)), compressor)
        table.right("DICOM", f"{compressor}, lossless", path, truth)
    large = np.tile(values, (8, 8, 1))  # GDCM does not decode RLE of very few pixels
    rle = slices(large, affine)
    for image in rle:
        image.compress(pydicom.uid.RLELossless)
    table.right("DICOM", "RLE", save(folder / "rle", rle), (large, affine))
    twice = slices(values, affine)
    copies = save(folder / "copies", [*twice, *twice])
    table.right_truth("DICOM", "files copied beside themselves", copies, *truth)
    order = np.random.default_rng(2).permutation(7)
    frames = (2 * values - 7, affine)
    for name, given in (("frames in order", None), ("frames in any order", order)):
        path = save(folder / name, [dicom_files.enhanced(values, affine, given)])
        table.right_truth("enhanced DICOM", name, path, *frames)
    dicom_defects(table)


def recoded(folder: Path, compressor: str) -> Path:
    """The files of a folder compressed by GDCM."""
    for file in sorted(folder.iterdir()):
        image = sitk.ReadImage(str(file))
        writer = sitk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        writer.UseCompressionOn()
        writer.SetCompressor(compressor)
        writer.SetFileName(str(file))
        writer.Execute(image)
    return folder


def dicom_defects(table: Table) -> None:
    values, affine = grey(), oblique()

    def refuse(defect: str, images: list[Any], reason: str) -> None:
        table.refuse("DICOM", defect, save(table.folder / defect, images), reason)

    def changed(**fields: Any) -> list[Any]:
        images = slices(values, affine)
        for name, value in fields.items():
            setattr(images[3], name, value)
        return images

    images = slices(values, affine)
    refuse("two missing slices", images[:3] + images[5:], "2 missing between")
    refuse("every second slice of a part missing", images[:4] + images[5:], "1 missing between")
    refuse("two echoes", [*images, *slices(values, affine, EchoTime=5.75)], "2 echoes (3.45, 5.75 ms)")
    refuse("two series", [*images, *slices(values, affine, SeriesInstanceUID="1.2.9")], "2 DICOM series")
    other = slices(*stored_as("ASR", values, affine))
    refuse("localiser", [*images[:3], *other[:3]], "other planes")
    turned = stored_as("ARS", values, affine)
    refuse("slices turned in their plane", [*images, *slices(*turned)], "other planes")
    refuse("two sizes", [*images, *slices(values[:-1], affine)[:1]], "pixels")
    refuse("two pixel sizes", changed(PixelSpacing=[0.61, 0.5]), "have pixels of")
    refuse("tilted gantry", slices(values, bent(affine, 2, 1, 0.3)), "right angle")
    refuse("repeated slices", [*images, *slices(values, affine)], "where another one does")
    beside = [float(c) + 0.1 for c in images[3].ImagePositionPatient]
    refuse("a slice shifted", changed(ImagePositionPatient=beside), "beside an even grid")
    refuse("phase", slices(values, affine, ImageType=["ORIGINAL", "PRIMARY", "P", "ND"]), "phase images")
    inverse = slices(values, affine, PhotometricInterpretation="MONOCHROME1")
    refuse("MONOCHROME1", inverse, "MONOCHROME1")
    colour = slices(values, affine, PhotometricInterpretation="RGB", SamplesPerPixel=3)
    for image in colour:
        image.PixelData = image.PixelData * 3
    refuse("colours", colour, "RGB")
    refuse("mosaic", slices(values, affine, ImageType=["ORIGINAL", "PRIMARY", "M", "MOSAIC"]), "mosaic")
    refuse("one slice", images[:1], "one slice")
    frames = slices(values, affine)[:1]
    frames[0].NumberOfFrames = 7
    dicom_files.put_pixels(frames[0], np.ascontiguousarray(values.T))
    refuse("frames without places", frames, "without a place")
    unplaced = slices(values, affine)
    for image in unplaced:
        del image.ImagePositionPatient
    refuse("no places", unplaced, "none with a place")
    refuse("two frames of reference", changed(FrameOfReferenceUID="1.2.6"), "frames of reference")
    slopes = dicom_files.enhanced(values, affine)
    del slopes.SharedFunctionalGroupsSequence[0].PixelValueTransformationSequence
    for k, frame in enumerate(slopes.PerFrameFunctionalGroupsSequence):
        rescale = dicom_files.group(RescaleSlope=str(1 + k), RescaleIntercept="0", RescaleType="US")
        frame.PixelValueTransformationSequence = pydicom.Sequence([rescale])
    refuse("enhanced, several slopes", [slopes], "7 slopes")
    dicom_damage(table)


def dicom_damage(table: Table) -> None:
    values, affine = grey(), oblique()

    def spoilt(name: str, spoil: Callable[[Path], object]) -> Path:
        path = save(table.folder / name, slices(values, affine))
        spoil(sorted(path.iterdir())[3])
        return path

    def cut(file: Path) -> None:
        file.write_bytes(file.read_bytes()[:-60])

    def widen(file: Path) -> None:
        image = pydicom.dcmread(file)
        image.Rows, image.Columns = 60000, 60000
        image.save_as(file)

    def lengthen(file: Path) -> None:
        data = bytearray(file.read_bytes())
        data[data.index(b"t1", 200) - 2] = 255  # the length of the series' description
        data[data.index(b"t1", 200) - 1] = 255
        file.write_bytes(data)

    def strip(file: Path) -> None:
        image = pydicom.dcmread(file)
        del image.PixelData
        image.save_as(file)

    table.refuse("DICOM", "an element longer than its file", spoilt("long", lengthen), "IM0003")
    table.refuse("DICOM", "a file without pixels", spoilt("strip", strip), "pixels: are missing")
    table.refuse("DICOM", "truncated file", spoilt("cut", cut), "IM0003")
    table.refuse("DICOM", "empty file", spoilt("empty", lambda f: os.truncate(f, 0)), "IM0003")
    table.refuse("DICOM", "declares 7 GB", spoilt("wide", widen), "header declares")
    garbage = spoilt("garbage", lambda f: f.write_bytes(b"garbage" * 100))
    table.refuse("DICOM", "damaged file", garbage, "IM0003")
    for name in ("none", "text"):
        (table.folder / name).mkdir()
    (table.folder / "text" / "notes.txt").write_text("no images")
    table.refuse("DICOM", "empty folder", table.folder / "none", "0 DICOM images")
    table.refuse("DICOM", "folder without images", table.folder / "text", "0 DICOM images")


def dicom_choices(table: Table) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    second = values + 1000
    both = save(folder / "series", slices(values, affine))
    save(both, slices(second, affine, SeriesInstanceUID="1.2.9", SeriesNumber=6, SeriesDescription="t2"))
    for chosen in (6, "t2", "1.2.9"):
        table.right("DICOM", f"series {chosen}", both, (second, affine), series=chosen)
    table.refuse("DICOM", "no such series", both, "5 (t1), 7 images; 6 (t2), 7 images", series=9)
    echoes = save(folder / "echoes", slices(second, affine, EchoTime=5.75))
    save(echoes, slices(values, affine))
    table.right("DICOM", "echo 1", echoes, (values, affine), echo=1)
    table.right("DICOM", "echo 2", echoes, (second, affine), echo=2)
    table.refuse("DICOM", "no such echo", echoes, "has 2", echo=3)
    frames = save(folder / "frames", [dicom_files.enhanced(values, affine, echoes=(3.45, 5.75))])
    table.right("enhanced DICOM", "echo 2", frames, (2 * second - 7, affine), echo=2)
    table.refuse("enhanced DICOM", "two echoes", frames, "2 echoes")
    phases = save(folder / "phases", slices(values, affine))
    save(phases, slices(second, affine, ImageType=["ORIGINAL", "PRIMARY", "P", "ND"]))
    table.right_truth("DICOM", "magnitudes among phases", phases, values, affine)
    nii = save_nifti(folder / "a.nii", values)
    table.refuse("NIfTI", "a series is chosen", nii, "only DICOM", series=5)
