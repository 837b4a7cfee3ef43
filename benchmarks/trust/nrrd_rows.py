"""NRRD and the segmentations of 3D Slicer."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import nrrd
import numpy as np
from numpy.typing import NDArray

from benchmarks.trust.volume_table import Table, bent, drawn, edited, grey, oblique, stored_as
from handpipe.core import Array
from handpipe.imaging.volumes.volume import Labels


def nrrd_header(affine: Array, space: str = "left-posterior-superior", **fields: Any) -> dict[str, Any]:
    """A header in a space whose axes are those of RAS or against them."""
    initials = [name[0] for name in space.split("-")] if "-" in space else space.lower()
    signs = np.diag([*(1.0 if i in "ras" else -1.0 for i in initials), 1.0])
    own = signs @ affine
    return {"space": space, "space directions": own[:3, :3].T, "space origin": own[:3, 3]} | fields


def save_nrrd(path: Path, values: NDArray, header: dict[str, Any], **options: Any) -> Path:
    nrrd.write(str(path), values, header, **options)
    return path


def nrrd_volumes(table: Table) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    truth = (values, affine)
    path = folder / "a.nrrd"
    for space in ("left-posterior-superior", "right-anterior-superior", "left-anterior-superior", "RAS"):
        table.right("NRRD", space, save_nrrd(path, values, nrrd_header(affine, space)), truth)
    turned, turning = stored_as("ASL", values, affine)
    table.right("NRRD", "axes ASL", save_nrrd(path, turned, nrrd_header(turning)), truth)
    for encoding in ("raw", "ascii"):
        written = save_nrrd(path, values, nrrd_header(affine, encoding=encoding))
        table.right("NRRD", encoding, written, truth)
    bz2 = save_nrrd(path, values, nrrd_header(affine, encoding="bzip2"))
    table.right_truth("NRRD", "bzip2", bz2, *truth)
    table.right("NRRD", "big-endian", save_nrrd(path, values.astype(">i2"), nrrd_header(affine)), truth)
    detached = save_nrrd(folder / "d.nhdr", values, nrrd_header(affine), detached_header=True)
    table.right("NRRD", "detached", detached, truth)
    upper = shutil.copy(save_nrrd(path, values, nrrd_header(affine)), folder / "B.NRRD")
    table.right_truth("NRRD", "upper-case suffix", Path(upper), *truth)
    metres = nrrd_header(np.diag([1e-3, 1e-3, 1e-3, 1]) @ affine)
    written = save_nrrd(path, values, metres | {"space units": ["m", "m", "m"]})
    table.right_truth("NRRD", "metres", written, *truth)
    single = listed(folder / "n.nrrd", values[None])
    table.right_truth("NRRD", "an axis of one without direction", single, *truth)
    nrrd_defects(table)


def listed(path: Path, values: NDArray, **fields: Any) -> Path:
    """NRRD whose first axis has no direction."""
    header = nrrd_header(oblique()) | {"kinds": ["list", "domain", "domain", "domain"]} | fields
    header["space directions"] = np.vstack([np.full(3, np.nan), header["space directions"]])
    return save_nrrd(path, values, header)


def nrrd_defects(table: Table) -> None:
    folder, values, affine = table.folder, grey(), oblique()
    path = folder / "bad.nrrd"

    def refuse(defect: str, written: Path, reason: str) -> None:
        table.refuse("NRRD", defect, written, reason)

    def good(**fields: Any) -> Path:
        return save_nrrd(path, values, nrrd_header(affine, **fields))

    refuse("no space", edited(good(), "space: ", "space dimension: 3"), "space: is 'missing'")
    refuse("a space without sides", edited(good(), "space: ", "space: scanner-xyz"), "scanner-xyz")
    refuse("no directions", edited(good(), "space directions", ""), "space directions are missing")
    refuse("colours", listed(path, np.stack([values] * 3)), "3 values")
    inches = nrrd_header(affine) | {"space units": ["inch", "inch", "inch"]}
    refuse("unknown unit", save_nrrd(path, values, inches), "inch")
    refuse("shear", save_nrrd(path, values, nrrd_header(bent(affine, 0, 1, 0.1))), "right angle")
    refuse("flat", save_nrrd(path, values, nrrd_header(affine * [1, 0, 1, 1])), "singular")
    spoilt = values.astype(np.float32)
    spoilt[0, 0, 0] = np.nan
    refuse("NaN", save_nrrd(path, spoilt, nrrd_header(affine)), "NaN")
    raw = good(encoding="raw").read_bytes()
    path.write_bytes(raw[:-100])
    refuse("truncated", path, "cannot be read as NRRD")
    packed = good(encoding="gzip").read_bytes()
    path.write_bytes(packed[:-100])
    refuse("truncated gzip", path, "cannot be read as NRRD")
    flipped = bytearray(packed)
    flipped[-6] ^= 1  # of the checksum
    path.write_bytes(flipped)
    refuse("wrong checksum", path, "cannot be read as NRRD")
    path.write_bytes(packed[:-400] + bytes(100) + packed[-300:])
    refuse("damaged gzip", path, "cannot be read as NRRD")
    refuse("declares 32 GB", edited(good(), "sizes: ", "sizes: 4000 2000 2000"), "header declares")
    zeros = save_nrrd(path, np.zeros((300, 300, 300), np.int16), nrrd_header(affine))
    refuse("inflates beyond its sizes", edited(zeros, "sizes: ", "sizes: 9 8 7"), "more voxels than")
    refuse("negative sizes", edited(good(), "sizes: ", "sizes: 9 -8 7"), "sizes")
    detached = save_nrrd(folder / "d.nhdr", values, nrrd_header(affine), detached_header=True)
    (folder / "d.raw.gz").unlink()
    refuse("voxels not beside the header", detached, "cannot be read as NRRD")


def segments(*found: tuple[str, int, int]) -> dict[str, str]:
    """Fields of segments (name, layer, value)."""
    fields = {}
    for n, (name, layer, value) in enumerate(found):
        fields[f"Segment{n}_ID"], fields[f"Segment{n}_Name"] = f"Segment_{n}", name
        fields[f"Segment{n}_Layer"], fields[f"Segment{n}_LabelValue"] = str(layer), str(value)
    return fields


NAMED = segments(("Near", 0, 7), ("far", 1, 7), ("Background", 1, 3))


def layers(labels: Labels) -> NDArray[np.uint8]:
    """Two layers of drawn labels with the values of `NAMED`."""
    first, second = np.where(labels == 1, 7, 0), np.where(labels == 2, 7, np.where(labels == 255, 3, 0))
    return np.stack([first, second]).astype(np.uint8)


def segmentations(table: Table) -> None:
    folder, labels = table.folder, drawn()
    path = folder / "a.seg.nrrd"
    one = np.where(labels == 255, 3, labels)
    flat = segments(("near", 0, 1), ("far", 0, 2), ("background", 0, 3))

    def saved(values: NDArray, affine: Array, fields: dict[str, str]) -> Path:
        return save_nrrd(path, values, nrrd_header(affine, **fields))

    table.right_labels("seg.nrrd", "one layer", saved(one, oblique(), flat), labels)
    table.right_labels("seg.nrrd", "two layers", listed(path, layers(labels), **NAMED), labels)
    part = labels.copy()
    part[:, 0], part[0] = 0, 0
    moved = oblique()
    moved[:3, 3] += oblique()[:3, :3] @ [1, 2, 1]
    table.right_labels("seg.nrrd", "cropped", saved(part[1:, 2:7, 1:6], moved, flat), part)
    table.right_labels(
        "seg.nrrd", "cropped, axes LPS", saved(*stored_as("LPS", part[1:, 2:7, 1:6], moved), flat), part
    )
    old = {k: v for k, v in NAMED.items() if not k.endswith(("_Layer", "_LabelValue"))}
    binary = np.stack([labels == 1, labels == 2, labels == 255]).astype(np.uint8)
    table.right_labels("seg.nrrd", "a component a segment", listed(path, binary, **old), labels)

    def refuse(defect: str, written: Path, reason: str) -> None:
        table.refuse_labels("seg.nrrd", defect, written, reason)

    other = segments(("near", 0, 1), ("Segment_2", 0, 2))
    refuse("a name that is no bone's", saved(one, oblique(), other), "'Segment_2'")
    refuse("no names", saved(one, oblique(), {}), "there are none")
    shared = layers(labels)
    shared[1, 2:4, 3:5, 2:4] = 7
    refuse("two bones in a voxel", listed(path, shared, **NAMED), "Near and far share 8 voxels")
    refuse("a layer that is not there", listed(path, layers(labels)[:1], **NAMED), "layer 1 of 1")
    half = oblique()
    half[:3, 3] += 0.5 * half[:3, 0]
    refuse("half a voxel off", saved(one, half, flat), "the volume has")
    refuse("other voxels", saved(one, oblique() * [0.5, 0.5, 0.5, 1], flat), "the volume has")
    away = oblique()
    away[:3, 3] += 3 * away[:3, 0]
    refuse("labels beyond the volume", saved(one, away, flat), "beyond the volume")
    table.refuse("seg.nrrd", "given as an image", saved(one, oblique(), flat), "segmentation")
