"""NIfTI: dialects that have to be read, defects that have to be refused, and labels."""

from __future__ import annotations

import gzip
import shutil
import struct
from pathlib import Path

import nibabel
import numpy as np
from numpy.typing import NDArray

from benchmarks.trust.volume_table import Table, bent, by_nibabel, drawn, grey, oblique, stored_as
from handpipe.core import Array

REAL = Path(__file__).parents[3] / "shared" / "data" / "real_mri"


def save_nifti(
    path: Path, values: NDArray, affine: Array | None = None, kind: type = nibabel.Nifti1Image
) -> Path:
    """Write NIfTI with its voxels in mm."""
    image = kind(values, oblique() if affine is None else affine)
    image.header.set_xyzt_units("mm")
    image.to_filename(path)
    return path


def nifti(table: Table) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    truth = (values, affine)
    nii, gz = folder / "a.nii", folder / "a.nii.gz"
    table.right("NIfTI", "plain", save_nifti(nii, values), truth)
    table.right("NIfTI", "gzipped", save_nifti(gz, values), truth)
    upper = shutil.copy(gz, folder / "B.NII.GZ")
    table.right_truth("NIfTI", "upper-case suffix", Path(upper), *truth)
    for codes in ("LPS", "LAS", "ASL", "PIR", "SRA"):
        turned, turning = stored_as(codes, values, affine)
        table.right("NIfTI", f"axes {codes}", save_nifti(folder / "o.nii", turned, turning), truth)
    table.right("NIfTI", "fourth axis of one", save_nifti(folder / "4.nii", values[..., None]), truth)
    second = save_nifti(folder / "2.nii", values, kind=nibabel.Nifti2Image)
    table.right("NIfTI-2", "plain", second, truth)
    big = nibabel.Nifti1Image(values, affine, nibabel.Nifti1Header(endianness=">"))
    big.to_filename(folder / "big.nii")
    table.right("NIfTI", "big-endian", folder / "big.nii", truth)
    table.right("NIfTI", "doubles", save_nifti(folder / "d.nii", values.astype(float)), truth)
    scaled = nibabel.Nifti1Image(values, affine)
    scaled.header.set_slope_inter(0.5, -3)
    scaled.to_filename(folder / "s.nii")
    table.right("NIfTI", "slope and intercept", folder / "s.nii", (0.5 * values - 3, affine))
    qform = nibabel.Nifti1Image(values, affine)
    qform.set_qform(affine, 1)
    qform.set_sform(None, 0)
    qform.to_filename(folder / "q.nii")
    table.right("NIfTI", "qform alone", folder / "q.nii", truth)
    for unit, share in (("meter", 1e-3), ("micron", 1e3)):
        image = nibabel.Nifti1Image(values, np.diag([share, share, share, 1]) @ affine)
        image.header.set_xyzt_units(unit)
        image.to_filename(folder / f"{unit}.nii")
        table.right("NIfTI", unit, folder / f"{unit}.nii", truth)
    nifti_defects(table, gz)


def nifti_defects(table: Table, good: Path) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    path = folder / "bad.nii"

    def refuse(defect: str, written: Path, reason: str) -> None:
        table.refuse("NIfTI", defect, written, reason)

    refuse("two volumes", save_nifti(path, np.stack([values, values], -1)), "2 volumes")
    refuse("two dimensions", save_nifti(path, values[:, :, 0]), "not a 3D volume")
    colour = np.zeros(values.shape, [("R", "u1"), ("G", "u1"), ("B", "u1")])
    refuse("colours", save_nifti(path, colour), "3 values")
    refuse("complex numbers", save_nifti(path, values.astype(np.complex64)), "complex")
    for name, wrong in (("NaN", np.nan), ("infinite", np.inf), ("beyond float32", 1e300)):
        spoilt = values.astype(float)
        spoilt[1, 2, 3] = wrong
        refuse(name, save_nifti(path, spoilt), "1 voxels are NaN, infinite")
    data = good.read_bytes()
    damaged = folder / "damaged.nii.gz"
    damaged.write_bytes(data[:200] + bytes(100) + data[300:])
    refuse("damaged gzip", damaged, "cannot be read as NIfTI")
    flipped = bytearray(data)
    flipped[-6] ^= 1  # of the checksum
    damaged.write_bytes(flipped)
    refuse("wrong checksum", damaged, "cannot be read as NIfTI")
    save_nifti(folder / "long.nii.gz", np.zeros((200, 200, 200), np.int16))
    longer = gzip.decompress((folder / "long.nii.gz").read_bytes())
    damaged.write_bytes(gzip.compress(longer[:42] + struct.pack("<3h", 9, 8, 7) + longer[48:]))
    refuse("inflates beyond its sizes", damaged, "holds more")
    damaged.write_bytes(data[: len(data) // 2])
    refuse("truncated gzip", damaged, "cannot be read as NIfTI")
    path.write_bytes(save_nifti(path, values).read_bytes()[:-500])
    refuse("truncated", path, "truncated")
    path.write_bytes(b"not an image")
    refuse("another content", path, "cannot be read as NIfTI")
    path.write_bytes(data)
    refuse("gzipped without .gz", path, "content")
    refuse("declares 32 GB in 62 bytes", declared(folder / "bomb.nii.gz"), "header declares")
    whole = save_nifti(path, values)
    refuse("no orientation", patched(whole, 252, "<2h", 0, 0), "neither sform nor qform")
    both = nibabel.Nifti1Image(values, affine)
    both.set_qform(affine @ np.diag([-1, 1, 1, 1]), 1)
    both.set_sform(affine, 1)
    both.to_filename(path)
    refuse("sform against qform", path, "sform and qform")
    refuse("shear", save_nifti(path, values, bent(affine, 2, 0, 0.2)), "right angle")
    refuse("flat affine", patched(save_nifti(path, values), 312, "<4f", 0, 0, 0, 30), "singular")
    refuse("negative sizes", patched(save_nifti(path, values), 42, "<3h", 9, -8, 7), "not a 3D volume")
    refuse("unknown type", patched(save_nifti(path, values), 70, "<h", 999), "cannot be read as NIfTI")
    refuse("metres", save_nifti(path, values, np.diag([5e-4, 5e-4, 5e-4, 1])), "probably metres")
    refuse("micrometres", save_nifti(path, values, np.diag([500.0, 500, 500, 1])), "probably micrometres")


def patched(path: Path, offset: int, format: str, *numbers: float) -> Path:
    """The file with numbers of its header replaced."""
    data = bytearray(path.read_bytes())
    struct.pack_into(format, data, offset, *numbers)
    path.write_bytes(data)
    return path


def declared(path: Path) -> Path:
    """A gzipped header of 4000 x 2000 x 2000 shorts, without voxels."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, 4000, 2000, 2000, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 4, 16)
    struct.pack_into("<f", header, 108, 352.0)
    header[344:348] = b"n+1\0"
    path.write_bytes(gzip.compress(bytes(header), mtime=0))
    return path


def nifti_labels(table: Table) -> None:
    folder, labels = table.folder, drawn()
    path = folder / "l.nii"
    table.right_labels("NIfTI", "labels", save_nifti(path, labels), labels)
    turned, affine = stored_as("LIP", labels, oblique())
    table.right_labels("NIfTI", "labels, axes LIP", save_nifti(path, turned, affine), labels)
    sloped = nibabel.Nifti1Image(labels, oblique())
    sloped.header.set_slope_inter(1.0000001, 0)
    sloped.to_filename(path)
    table.right_labels("NIfTI", "labels, slope 1.0000001", path, labels)
    real = save_nifti(path, labels.astype(np.float64))
    table.right_labels("NIfTI", "labels as doubles", real, labels)
    half = labels / 2
    table.refuse_labels("NIfTI", "fractions", save_nifti(path, half.astype(np.float32)), "not integers")
    table.refuse_labels("NIfTI", "beyond 255", save_nifti(path, labels.astype(np.int16) * 2), "not integers")
    moved = oblique()
    moved[0, 3] += 0.1
    table.refuse_labels("NIfTI", "moved by 0.1 mm", save_nifti(path, labels, moved), "the volume has")
    table.refuse_labels("NIfTI", "a slice short", save_nifti(path, labels[..., 1:]), "9 x 8 x 6")


def real(table: Table) -> None:
    """The foot, where it is: axes A-S-L, qform alone."""
    for path in sorted((REAL / "foot_dixon").glob("*.nii.gz")):
        table.right("NIfTI", f"real foot {path.name[:4]}", path, by_nibabel(path))
