"""A subject in other formats gives the bones of the same subject in NIfTI, in axes closest to RAS."""

from pathlib import Path

import nibabel
import numpy as np
import yaml
from benchmarks.trust.dicom_files import save, slices
from benchmarks.trust.nrrd_rows import nrrd_header, save_nrrd, segments
from benchmarks.trust.volume_table import stored_as

from .running import run
from .small_subject import AFFINE, LABELS, image, seeds, write_dataset, write_image


def test_bones_do_not_depend_on_the_format(small: Path, built_small: Path) -> None:
    """Two DICOM series in one folder, a segmentation by names, and a left-handed NIfTI."""
    data, file = small / "small", small / "config/datasets/small.yaml"
    values = image().astype(np.uint16)
    dicom = save(data / "bent", slices(*stored_as("LIP", values, AFFINE)))
    save(dicom, slices(values // 2 + 7, AFFINE, SeriesInstanceUID="1.2.9", SeriesNumber=6))
    named = segments(*((name.title(), 0, label) for name, label in LABELS.items()), ("background", 0, 255))
    save_nrrd(data / "bent.seg.nrrd", seeds(), nrrd_header(AFFINE, **named))
    for name, content in (("flat", image()), ("flat-seeds", seeds())):
        write_image(data / f"{name}.nii.gz", *stored_as("LAS", content, AFFINE))
    subject = yaml.safe_load(file.read_text(encoding="utf-8"))
    subject["poses"]["bent"] |= {"volume": "bent", "series": 5, "seeds": "bent.seg.nrrd"}
    write_dataset(small, subject)

    process = run(small, "-j2", "segmentation", "--config", "subjects=[small]")
    assert process.returncode == 0, process.stdout
    for pose in ("flat", "bent"):
        label_file = f"results/small/segmentation/{pose}/labels.nii.gz"
        found, expected = (nibabel.load(folder / label_file) for folder in (small, built_small))
        np.testing.assert_allclose(found.affine, expected.affine, atol=1e-5)
        difference = np.asarray(found.dataobj) != np.asarray(expected.dataobj)
        assert difference.sum() <= 2  # DICOM rounds places to a millionth of a mm
