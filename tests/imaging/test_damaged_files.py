"""Bytes of image files changed at random: a file is read or refused, and no other exception is raised."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.trust import dicom_files
from benchmarks.trust.meta_image_rows import save_meta_image
from benchmarks.trust.nifti_rows import save_nifti
from benchmarks.trust.nrrd_rows import NAMED, layers, listed, nrrd_header, save_nrrd
from benchmarks.trust.volume_table import BONES, drawn, grey, grid, oblique

from handpipe.core.errors import InputError
from handpipe.imaging.volumes.volume import read_labels, read_volume

HEADER = 700  # bytes; most damage to voxels changes their values alone
DAMAGES = 40


def write(folder: Path, name: str) -> Path:
    """A good file, or a folder of DICOM."""
    values, affine, path = grey(), oblique(), folder / name
    if name.endswith((".nii", ".nii.gz")):
        return save_nifti(path, values)
    if name == "a.seg.nrrd":
        return listed(path, layers(drawn()), **NAMED)
    if name.endswith("nrrd"):
        return save_nrrd(path, values, nrrd_header(affine, encoding="ascii" if name[0] == "t" else "gzip"))
    if name.endswith("mha"):
        return save_meta_image(path, values, affine, compress=name[0] == "c")
    if name == "series":
        return dicom_files.save(path, dicom_files.slices(values, affine))
    return dicom_files.save(path, [dicom_files.enhanced(values, affine)])


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Up to three bytes changed or short runs removed."""
    changed = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at = rng.integers(0, min(len(changed), HEADER))
        if rng.random() < 0.7:
            changed[at] = rng.integers(256)
        else:
            del changed[at : at + rng.integers(1, 8)]
    return bytes(changed)


FILES = ("a.nii", "a.nii.gz", "a.nrrd", "t.nrrd", "a.seg.nrrd", "a.mha", "c.mha", "series", "enhanced")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_read_or_refused(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(sum(name.encode()))
    path = write(tmp_path, name)
    file = next(iter(sorted(path.iterdir()))) if path.is_dir() else path
    good, refused = file.read_bytes(), 0
    for _ in range(DAMAGES):
        file.write_bytes(damaged(good, rng))
        try:
            _ = read_labels(path, grid(), BONES) if name == "a.seg.nrrd" else read_volume(path)
        except InputError:
            refused += 1
    assert 0 < refused <= DAMAGES
