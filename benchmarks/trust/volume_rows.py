"""Rows of image volumes: NIfTI, NRRD, segmentations, MetaImage and DICOM, each right or refused."""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.trust.dicom_files import save, slices
from benchmarks.trust.dicom_rows import dicom, dicom_choices
from benchmarks.trust.meta_image_rows import meta_images, save_meta_image
from benchmarks.trust.nifti_rows import nifti, nifti_labels, real, save_nifti
from benchmarks.trust.nrrd_rows import nrrd_header, nrrd_volumes, save_nrrd, segmentations
from benchmarks.trust.readers import Row
from benchmarks.trust.volume_table import Table, grey, oblique


def rows() -> list[Row]:
    """All rows; a file lives as long as its row."""
    found = []
    for table in TABLES:
        with tempfile.TemporaryDirectory() as folder:
            made = Table(Path(folder))
            table(made)
            found += made.rows
    return found


def paths(table: Table) -> None:
    """Folders and files with blanks, brackets and letters beyond ASCII."""
    folder = table.folder / "Fuß [links] {2} 手"
    folder.mkdir()
    values, affine = grey(), oblique()
    dialect = "a folder of any name"
    table.right("NIfTI", dialect, save_nifti(folder / "Bild 1.nii.gz", values), (values, affine))
    nrrd = save_nrrd(folder / "Bild [1].nrrd", values, nrrd_header(affine))
    table.right("NRRD", dialect, nrrd, (values, affine))
    table.right("MetaImage", dialect, save_meta_image(folder / "ä ö.mhd", values, affine), (values, affine))
    table.right("DICOM", dialect, save(folder / "Größe", slices(values, affine)), (values, affine))


TABLES = (nifti, nifti_labels, nrrd_volumes, segmentations, meta_images, dicom, dicom_choices, paths, real)
