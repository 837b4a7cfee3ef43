"""MetaImage: .mha and .mhd."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray

from benchmarks.trust.dicom_files import LPS_TO_RAS
from benchmarks.trust.volume_table import Table, edited, grey, oblique, stored_as
from handpipe.core import Array


def save_meta_image(path: Path, values: NDArray, affine: Array, compress: bool = False) -> Path:
    image = sitk.GetImageFromArray(values.T, isVector=False)
    lps = LPS_TO_RAS @ affine
    spacing = np.linalg.norm(lps[:3, :3], axis=0)
    if values.ndim == 3:
        image.SetSpacing(spacing.tolist())
        image.SetDirection((lps[:3, :3] / spacing).ravel().tolist())
        image.SetOrigin(lps[:3, 3].tolist())
    sitk.WriteImage(image, str(path), compress)
    return path


def meta_images(table: Table) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    truth = (values, affine)
    path = folder / "a.mha"
    table.right("MetaImage", "mha", save_meta_image(path, values, affine), truth)
    table.right("MetaImage", "compressed", save_meta_image(path, values, affine, compress=True), truth)
    table.right("MetaImage", "mhd", save_meta_image(folder / "b.mhd", values, affine), truth)
    turned, turning = stored_as("LAS", values, affine)
    table.right("MetaImage", "axes LAS", save_meta_image(path, turned, turning), truth)
    table.right("MetaImage", "doubles", save_meta_image(path, values.astype(float), affine), truth)
    upper = shutil.copy(save_meta_image(path, values, affine), folder / "C.MHA")
    table.right("MetaImage", "upper-case suffix", Path(upper), truth)

    def refuse(defect: str, written: Path, reason: str) -> None:
        table.refuse("MetaImage", defect, written, reason)

    def good(compress: bool = False) -> Path:
        return save_meta_image(path, values, affine, compress)

    refuse("no directions", edited(good(), "TransformMatrix", ""), "TransformMatrix is missing")
    refuse("no spacing", edited(good(), "ElementSpacing", ""), "ElementSpacing is missing")
    refuse("negative spacing", edited(good(), "ElementSpacing", "ElementSpacing = -1 1 1"), "ElementSpacing")
    refuse("zero spacing", edited(good(), "ElementSpacing", "ElementSpacing = 0 1 1"), "ElementSpacing")
    refuse("declares 32 GB", edited(good(), "DimSize", "DimSize = 4000 2000 2000"), "header declares")
    data = good().read_bytes()
    path.write_bytes(data[:-100])
    refuse("truncated", path, "header declares")
    packed = good(compress=True).read_bytes()
    path.write_bytes(packed[:-100])
    refuse("truncated, compressed", path, "cannot be read as MetaImage")
    path.write_bytes(packed[:-300] + bytes(100) + packed[-200:])
    refuse("damaged, compressed", path, "cannot be read as MetaImage")
    vectors = sitk.Compose([sitk.GetImageFromArray(values.T)] * 3)
    sitk.WriteImage(vectors, str(path))
    refuse("colours", path, "3 values")
    refuse("two volumes", save_meta_image(path, np.stack([values] * 2, -1), affine), "2 volumes")
    detached = save_meta_image(folder / "d.mhd", values, affine)
    (folder / "d.raw").unlink()
    refuse("voxels not beside the header", detached, "is not beside the header")
    path.write_bytes(b"not an image")
    refuse("another content", path, "cannot be read as MetaImage")
