"""Rows of image volumes: NIfTI, NRRD, segmentations, MetaImage and DICOM, each right or refused."""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.trust.dicom_rows import dicom, dicom_choices
from benchmarks.trust.meta_image_rows import meta_images
from benchmarks.trust.nifti_rows import nifti, nifti_labels, real
from benchmarks.trust.nrrd_rows import nrrd_volumes, segmentations
from benchmarks.trust.readers import Row
from benchmarks.trust.volume_table import Table


def rows() -> list[Row]:
    """All rows; a file lives as long as its row."""
    tables = (nifti, nifti_labels, nrrd_volumes, segmentations, meta_images, dicom, dicom_choices, real)
    found = []
    for table in tables:
        with tempfile.TemporaryDirectory() as folder:
            made = Table(Path(folder))
            table(made)
            found += made.rows
    return found
