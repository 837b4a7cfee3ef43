"""A scalar volume on a regular grid in physical space, and its readers and writers.

World coordinates are RAS in mm; `formats` reads each format and converts coordinates in LPS.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import nibabel
import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import Array, InputError, IntArray, atomic, write_text
from handpipe.core.configuration import Dataset
from handpipe.imaging.formats.dicom import read_dicom
from handpipe.imaging.formats.dicom_frames import is_dicom
from handpipe.imaging.formats.lattice import on_grid, require_finite, to_ras
from handpipe.imaging.formats.meta_image import read_meta_image
from handpipe.imaging.formats.nifti import read_nifti
from handpipe.imaging.formats.nrrd_image import read_nrrd
from handpipe.imaging.formats.segments import is_segmentation, read_segments
from handpipe.imaging.formats.stored import Stored

Labels = NDArray[np.uint8]

ROUNDING = 1e-3  # of a label: how far from a whole number a scaled one may be
BRIGHT = 98  # percentile of the values: bright tissue


@dataclass(frozen=True)
class Volume:
    """A scalar volume on a regular grid in physical space.

    Parameters
    ----------
    values : array (nx, ny, nz) of float32
        Intensity of each voxel.
    affine : array (4, 4)
        From voxel indices, whole at voxel centres, to world mm (RAS); right-handed.
    """

    values: NDArray[np.float32]
    affine: Array

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along each axis."""
        nx, ny, nz = self.values.shape
        return nx, ny, nz

    @property
    def spacing(self) -> Array:
        """Voxel size (3,) in mm."""
        return np.linalg.norm(self.affine[:3, :3], axis=0)

    @cached_property
    def bright(self) -> float:
        """The 98th percentile of its values: those of bright tissue."""
        return float(np.percentile(self.values, BRIGHT))

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
    """Slices of a box of voxels.

    Parameters
    ----------
    lower, upper : array (3,) of int
        First voxel along each axis, and the one after the last.

    Returns
    -------
    tuple of 3 slices
        The voxels lower <= index < upper.
    """
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


def read_volume(path: str | Path, series: int | str | None = None, echo: int | None = None) -> Volume:
    """Read NIfTI, NRRD, MetaImage or DICOM in RAS mm.

    Axes are stored in the order closest to RAS, whatever their order in the file is.

    Parameters
    ----------
    path : str or Path
        A file, or a folder of DICOM images.
    series : int or str, optional
        Of several DICOM series: number, description or UID.
    echo : int, optional
        Of several echoes of a DICOM series: from 1, in the order of echo times.

    Returns
    -------
    Volume
        Intensities as float32 on a right-handed grid.

    Raises
    ------
    InputError
        If the volume is missing, unreadable or larger than its file can hold; is not one scalar 3D volume on
        a grid of right angles; holds NaN or infinite values; or has voxels of metres or micrometres.
    """
    path = Path(path)
    stored = to_ras(path, _read(path, series, echo))
    require_finite(path, stored.values)
    return Volume(np.ascontiguousarray(stored.values, dtype=np.float32), stored.affine)


def pose_volume(dataset: Dataset, pose: str) -> Volume:
    """The volume of a pose, in the series and echo that the dataset chooses.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the subject.
    pose : str
        Name of one of its poses.

    Returns
    -------
    Volume
        Image of the pose, RAS mm.

    Raises
    ------
    InputError
        As `read_volume` does.
    """
    chosen = dataset.poses[pose]
    return read_volume(dataset.path(chosen.volume), chosen.series, chosen.echo)


def _read(path: Path, series: int | str | None = None, echo: int | None = None) -> Stored:
    if not path.exists():
        raise InputError(path, "volume", "does not exist", "Check the path in the dataset file")
    name = path.name.lower()
    readers = {
        (".nii", ".nii.gz"): read_nifti,
        (".nrrd", ".nhdr"): read_nrrd,
        (".mha", ".mhd"): read_meta_image,
    }
    chosen = next((read for ends, read in readers.items() if name.endswith(ends)), None)
    if path.is_dir() or (chosen is None and is_dicom(path)):
        return read_dicom(path, series, echo)
    if chosen is None:
        remedy = "Give .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, DICOM, or a folder of DICOM images"
        raise InputError(path, "format", "is not known", remedy)
    if series is not None or echo is not None:
        field = "series" if series is not None else "echo"
        raise InputError(path, field, "is chosen, but only DICOM has them", "Leave it out")
    if is_segmentation(path):
        raise InputError(path, "content", "is a segmentation, not an image", "Give it as seeds or scribbles")
    return chosen(path)


def write_volume(path: str | Path, volume: Volume) -> None:
    """Write NIfTI in RAS mm.

    Parameters
    ----------
    path : str or Path
        File to write, .nii or .nii.gz.
    volume : Volume
        Values, written as float32, and their grid.
    """
    _write_nifti(path, np.asarray(volume.values, np.float32), volume.affine)


def _write_nifti(path: str | Path, values: NDArray, affine: Array) -> None:
    image = nibabel.Nifti1Image(values, affine)
    image.header.set_xyzt_units("mm")
    with atomic(path) as temporary:
        nibabel.save(image, temporary)


def read_labels(
    path: str | Path, like: Volume | None = None, bones: Mapping[str, int] | None = None
) -> Labels:
    """Read a label volume of integers 0 to 255.

    Parameters
    ----------
    path : str or Path
        A label volume in any order of axes, or a segmentation of 3D Slicer (.seg.nrrd), which may cover a
        part of the grid.
    like : Volume, optional
        The volume that the labels were drawn on. Without it the labels keep their own grid.
    bones : mapping of str to int, optional
        Label of each bone by name; needed for a segmentation, whose segments are taken by their names.

    Returns
    -------
    array (nx, ny, nz) of uint8
        Label of each voxel, on the grid of `like` if given.

    Raises
    ------
    InputError
        As `read_volume` does; for values that are not labels, segments that are no bones, or another grid.
    """
    path = Path(path)
    turned = stored_labels(path, bones)
    if like is None:
        return turned.values
    return on_grid(path, turned, like.shape, like.affine, is_segmentation(path))


def stored_labels(path: Path, bones: Mapping[str, int] | None = None) -> Stored:
    """Labels on their own grid, axes in the order closest to RAS; arguments and errors of `read_labels`."""
    if is_segmentation(path):
        return to_ras(path, _segmentation(path, bones))
    stored = _read(path)
    return to_ras(path, Stored(_as_labels(path, stored.values), stored.affine))


def _segmentation(path: Path, bones: Mapping[str, int] | None) -> Stored:
    if bones is None:
        raise InputError(path, "content", "is a segmentation", "Save it as a label volume")
    if not path.exists():
        raise InputError(path, "volume", "does not exist", "Check the path in the dataset file")
    return read_segments(path, bones)


def _as_labels(path: Path, values: NDArray) -> Labels:
    """Whole numbers; a slope near 1 in a header leaves them off by rounding."""
    require_finite(path, values)
    whole = np.round(values)
    if whole.min() < 0 or whole.max() > 255 or np.abs(values - whole).max() > ROUNDING:
        raise InputError(path, "values", "are not integers from 0 to 255", "Save it as a label volume")
    return whole.astype(np.uint8)


def table_path(path: str | Path) -> Path:
    """Where the label table of a label volume lies: the same name with .json."""
    path = Path(path)
    return path.with_name(path.name.split(".")[0] + ".json")


def write_labels(
    path: str | Path, labels: Labels, affine: Array, table: Mapping[str, int] | None = None
) -> None:
    """Write labels as NIfTI, with their table as JSON beside it.

    Parameters
    ----------
    path : str or Path
        File to write; the table gets the same name with .json.
    labels : array (nx, ny, nz) of uint8
        Label of each voxel.
    affine : array (4, 4)
        From voxel indices to world mm (RAS).
    table : mapping of str to int, optional
        Label by name. Without it no table is written.
    """
    _write_nifti(path, np.asarray(labels, np.uint8), affine)
    if table is not None:
        write_text(table_path(path), json.dumps(dict(table), indent=2) + "\n")


def read_label_table(path: str | Path) -> dict[str, int]:
    """The table beside a label volume.

    Parameters
    ----------
    path : path
        The label volume.

    Returns
    -------
    dict of str to int
        Label by name.

    Raises
    ------
    InputError
        Where the table is missing or malformed.
    """
    beside = table_path(path)
    try:
        table = json.loads(beside.read_text(encoding="utf-8"))
        return {str(name): int(label) for name, label in table.items()}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise InputError(beside, "label table", f"cannot be read ({error})", "Write {name: label}") from error
