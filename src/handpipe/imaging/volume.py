"""A scalar volume on a regular grid in physical space, and its readers and writers.

World coordinates are RAS in mm. Formats that speak LPS (NRRD, DICOM) are converted here, once.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import nibabel
import nrrd
import numpy as np
import SimpleITK as sitk
from nibabel.filebasedimages import ImageFileError
from numba import njit
from numpy.typing import NDArray

from handpipe.artifacts import atomic, write_text
from handpipe.errors import InputError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Labels = NDArray[np.uint8]

LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
SPACING_RANGE = (0.02, 20.0)  # mm; a hand's voxels lie far inside


@dataclass(frozen=True)
class Volume:
    """values (nx, ny, nz) float32; affine (4, 4) from voxel indices (centres) to world mm, right-handed."""

    values: NDArray[np.float32]
    affine: Array

    @property
    def shape(self) -> tuple[int, int, int]:
        nx, ny, nz = self.values.shape
        return nx, ny, nz

    @property
    def spacing(self) -> Array:
        """Voxel size (3,) in mm."""
        return np.linalg.norm(self.affine[:3, :3], axis=0)

    @cached_property
    def bright(self) -> float:
        """The 98th percentile of its values: those of bright tissue."""
        return float(np.percentile(self.values, 98))

    def to_world(self, indices: NDArray) -> Array:
        """World points (n, 3) of continuous voxel indices (n, 3)."""
        return np.asarray(indices, float) @ self.affine[:3, :3].T + self.affine[:3, 3]

    def to_index(self, points: Array) -> Array:
        """Continuous voxel indices (n, 3) of world points (n, 3)."""
        return (points - self.affine[:3, 3]) @ np.linalg.inv(self.affine[:3, :3]).T

    def sample(self, points: Array) -> Array:
        """Trilinear values at world points (..., 3); beyond the grid, the value at its border."""
        flat = self.to_index(np.reshape(points, (-1, 3)))
        return _sample(self.values, flat).reshape(np.shape(points)[:-1])

    def gradient(self, points: Array) -> Array:
        """Central differences (..., 3) per mm over a voxel either side, in world directions."""
        flat = self.to_index(np.reshape(points, (-1, 3)))
        steps = np.eye(3)
        by_index = [(_sample(self.values, flat + e) - _sample(self.values, flat - e)) / 2 for e in steps]
        by_world = np.stack(by_index, axis=1) @ np.linalg.inv(self.affine[:3, :3])
        return by_world.reshape(np.shape(points))

    def crop(self, lower: IntArray, upper: IntArray) -> Volume:
        """The sub-volume of voxels lower <= index < upper, clipped to the grid."""
        lower, upper = np.maximum(lower, 0), np.minimum(upper, self.shape)
        affine = self.affine.copy()
        affine[:3, 3] = self.to_world(lower[None])[0]
        return Volume(self.values[box(lower, upper)], affine)

    def like(self, values: NDArray) -> Volume:
        """Other values on the same grid."""
        return Volume(np.ascontiguousarray(values, dtype=np.float32), self.affine)


def box(lower: IntArray, upper: IntArray) -> tuple[slice, slice, slice]:
    """Slices of the voxels lower <= index < upper."""
    x, y, z = (slice(int(a), int(b)) for a, b in zip(lower, upper, strict=True))
    return x, y, z


@njit(cache=True)
def _sample(values, indices):  # type: ignore[no-untyped-def]
    """Trilinear interpolation at continuous indices (n, 3), clamped to the grid."""
    shape = values.shape
    out = np.empty(len(indices))
    base = np.zeros(3, np.int64)
    frac = np.zeros(3)
    for p in range(len(indices)):
        for c in range(3):
            x = min(max(indices[p, c], 0.0), shape[c] - 1.0)
            base[c] = min(int(x), max(shape[c] - 2, 0))
            frac[c] = x - base[c]
        total = 0.0
        for a in range(2):
            wa = frac[0] if a else 1 - frac[0]
            for b in range(2):
                wb = frac[1] if b else 1 - frac[1]
                for c in range(2):
                    w = wa * wb * (frac[2] if c else 1 - frac[2])
                    if w > 0:
                        total += w * values[base[0] + a, base[1] + b, base[2] + c]
        out[p] = total
    return out


def read_volume(path: str | Path) -> Volume:
    """Read NIfTI, NRRD, or a folder of DICOM slices, in RAS mm.

    Raises `InputError` where the volume is missing, unreadable, not three-dimensional, holds NaN or
    infinite values, is left-handed, or has voxels that look like metres or micrometres.
    """
    values, affine = _read(Path(path))
    _check(path, values, affine)
    return Volume(np.ascontiguousarray(values, dtype=np.float32), affine)


def _read(path: Path) -> tuple[NDArray, Array]:
    if not path.exists():
        raise InputError(path, "volume", "does not exist", "Check the path in the dataset file")
    if path.is_dir():
        return _read_dicom(path)
    if path.name.endswith((".nii", ".nii.gz")):
        return _read_nifti(path)
    if path.name.endswith((".nrrd", ".nhdr")):
        return _read_nrrd(path)
    raise InputError(path, "format", "is not known", "Give .nii, .nii.gz, .nrrd, or a folder of DICOM slices")


def _read_nifti(path: Path) -> tuple[NDArray, Array]:
    try:
        image = nibabel.load(path)
        values = np.asanyarray(image.dataobj)  # type: ignore[attr-defined]
    except (ImageFileError, OSError, EOFError, ValueError) as error:
        raise InputError(path, "content", f"cannot be read as NIfTI ({error})", "Export it again") from error
    unit = image.header.get_xyzt_units()[0]  # type: ignore[attr-defined]
    if unit not in ("mm", "unknown"):
        raise InputError(path, "units", f"the header says {unit}", "Write voxel sizes in mm")
    return values, np.asarray(image.affine, np.float64)  # type: ignore[attr-defined]


def _read_nrrd(path: Path) -> tuple[NDArray, Array]:
    try:
        values, header = nrrd.read(str(path))
    except (nrrd.NRRDError, OSError, ValueError) as error:
        raise InputError(path, "content", f"cannot be read as NRRD ({error})", "Export it again") from error
    _require_3d(path, values)
    space = str(header.get("space", "missing")).lower()
    frames = {"left-posterior-superior": LPS_TO_RAS, "lps": LPS_TO_RAS}
    frames |= {"right-anterior-superior": np.eye(4), "ras": np.eye(4)}
    if space not in frames or "space directions" not in header:
        raise InputError(path, "space", f"is {space!r} or lacks directions", "Save it in LPS or RAS space")
    units = {u for u in header.get("space units", []) if u}
    if units - {"mm"}:
        raise InputError(path, "units", f"the header says {sorted(units)}", "Write voxel sizes in mm")
    affine = np.eye(4)
    affine[:3, :3] = np.asarray(header["space directions"], float).T
    affine[:3, 3] = header.get("space origin", np.zeros(3))
    return values, frames[space] @ affine


def _read_dicom(path: Path) -> tuple[NDArray, Array]:
    series = sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(path))
    if len(series) != 1:
        problem = f"holds {len(series)} DICOM series, not one"
        raise InputError(path, "volume", problem, "Give a folder with the slices of one series alone")
    files = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(path), series[0])
    image = sitk.ReadImage(files)
    affine = np.eye(4)
    affine[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * np.array(image.GetSpacing())
    affine[:3, 3] = image.GetOrigin()
    return sitk.GetArrayFromImage(image).T, LPS_TO_RAS @ affine


def _require_3d(path: str | Path, values: NDArray) -> None:
    if values.ndim != 3 or min(values.shape) < 2:
        raise InputError(path, "shape", f"is {values.shape}, not a 3D volume", "Give one scalar 3D volume")


def _check(path: str | Path, values: NDArray, affine: Array) -> None:
    _require_3d(path, values)
    if not np.isfinite(values).all():
        count = int((~np.isfinite(values)).sum())
        raise InputError(path, "values", f"{count} voxels are NaN or infinite", "Replace them before import")
    if not np.isfinite(affine).all() or np.linalg.det(affine[:3, :3]) == 0:
        raise InputError(path, "affine", "is singular or not finite", "Export it again with its orientation")
    _check_spacing(path, np.linalg.norm(affine[:3, :3], axis=0))
    if np.linalg.det(affine[:3, :3]) < 0:
        remedy = "Flip one axis of the array and of the affine (a mirrored hand is another hand)"
        raise InputError(path, "handedness", "the affine is left-handed", remedy)


def _check_spacing(path: str | Path, spacing: Array) -> None:
    if spacing.min() < SPACING_RANGE[0] or spacing.max() > SPACING_RANGE[1]:
        guess = "metres" if spacing.min() < SPACING_RANGE[0] else "micrometres"
        size = " x ".join(f"{s:g}" for s in spacing)
        raise InputError(path, "units", f"voxels of {size} mm; probably {guess}", "Write voxel sizes in mm")


def write_volume(path: str | Path, volume: Volume) -> None:
    """Write NIfTI in RAS mm."""
    _write_nifti(path, np.asarray(volume.values, np.float32), volume.affine)


def _write_nifti(path: str | Path, values: NDArray, affine: Array) -> None:
    image = nibabel.Nifti1Image(values, affine)
    image.header.set_xyzt_units("mm")
    with atomic(path) as temporary:
        nibabel.save(image, temporary)


def read_labels(path: str | Path, like: Volume | None = None) -> Labels:
    """Read a label volume of integers 0 to 255, on the grid of `like` where that is given.

    Raises `InputError` as `read_volume` does, and for values that are not labels or another grid.
    """
    values, affine = _read(Path(path))
    _check(path, values, affine)
    if values.min() < 0 or values.max() > 255 or (values != np.round(values)).any():
        raise InputError(path, "values", "are not integers from 0 to 255", "Save it as a label volume")
    if like is not None and not same_grid(values.shape, affine, like):
        problem = f"shape {values.shape} or affine differ from the volume's (shape {like.shape})"
        raise InputError(path, "grid", problem, "Draw the labels on the volume, or resample them to its grid")
    return values.astype(np.uint8)


def same_grid(shape: tuple[int, ...], affine: Array, volume: Volume) -> bool:
    """Whether a grid is the volume's, to a hundredth of a voxel at every corner."""
    if tuple(shape) != volume.shape:
        return False
    error = np.abs(affine - volume.affine)
    return bool(np.all(error[:3, :3] @ np.array(shape) + error[:3, 3] < 1e-2 * volume.spacing.min()))


def table_path(path: str | Path) -> Path:
    """Where the label table of a label volume lies: the same name with .json."""
    path = Path(path)
    return path.with_name(path.name.split(".")[0] + ".json")


def write_labels(
    path: str | Path, labels: Labels, affine: Array, table: Mapping[str, int] | None = None
) -> None:
    """Write labels (nx, ny, nz) as NIfTI and, where given, their table {name: label} as JSON beside it."""
    _write_nifti(path, np.asarray(labels, np.uint8), affine)
    if table is not None:
        write_text(table_path(path), json.dumps(dict(table), indent=2) + "\n")


def read_label_table(path: str | Path) -> dict[str, int]:
    """The table {name: label} beside a label volume."""
    beside = table_path(path)
    try:
        table = json.loads(beside.read_text(encoding="utf-8"))
        return {str(name): int(label) for name, label in table.items()}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise InputError(beside, "label table", f"cannot be read ({error})", "Write {name: label}") from error
