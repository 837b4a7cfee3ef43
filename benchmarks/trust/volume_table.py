"""One image in every format: what a reader has to find, and the rows of what it found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray

from benchmarks.trust.dicom_files import LPS_TO_RAS
from benchmarks.trust.readers import Row, read_right, refused
from handpipe.core import Array
from handpipe.imaging.volumes import Volume, read_labels, read_volume
from handpipe.imaging.volumes.volume import Labels

Image = tuple[NDArray, Array]  # values (ni, nj, nk), affine to RAS mm
BONES = {"near": 1, "far": 2}


@dataclass
class Table:
    """Files in a folder, and the rows of what came of reading them."""

    folder: Path
    rows: list[Row] = field(default_factory=list)

    def right(self, format: str, dialect: str, path: Path, truth: Image | None, **choice: Any) -> None:
        """The volume has to be the independent reader's, or the known `truth`, or both."""

        def mistake(volume: Volume) -> str:
            references = [] if truth is None else [truth]
            references += [read(path) for read in (() if choice else INDEPENDENT.get(format, ()))]
            return next(filter(None, (difference(volume, *r) for r in references)), "")

        self.rows.append(read_right(format, dialect, lambda: read_volume(path, **choice), mistake))

    def right_truth(self, format: str, dialect: str, path: Path, values: NDArray, affine: Array) -> None:
        """The volume has to be the known image: no independent reader knows this dialect."""
        self.rows.append(
            read_right(format, dialect, lambda: read_volume(path), lambda v: difference(v, values, affine))
        )

    def refuse(self, format: str, defect: str, path: Path, reason: str, **choice: Any) -> None:
        """The reader has to name the reason."""
        dialect = ", ".join(f"{k} {v}" for k, v in choice.items()) or "one volume"
        self.rows.append(refused(format, dialect, defect, lambda: read_volume(path, **choice), reason))

    def right_labels(self, format: str, dialect: str, path: Path, truth: Labels) -> None:
        def mistake(labels: Labels) -> str:
            return "" if np.array_equal(labels, truth) else "labels differ"

        def read() -> Labels:
            return read_labels(path, grid(), BONES)

        self.rows.append(read_right(format, dialect, read, mistake))

    def refuse_labels(self, format: str, defect: str, path: Path, reason: str) -> None:
        def read() -> Labels:
            return read_labels(path, grid(), BONES)

        self.rows.append(refused(format, "labels", defect, read, reason))


def difference(volume: Volume, values: NDArray, affine: Array) -> str:
    """What is wrong with a volume, given every voxel and its place; "" where nothing is."""
    places = np.indices(values.shape).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
    index = volume.to_index(places)
    whole = np.rint(index).astype(int)
    if volume.values.size != values.size or (whole < 0).any() or (whole >= volume.shape).any():
        return f"its grid is {volume.shape} at other places, not {values.shape}"
    if np.abs(index - whole).max() > 1e-3:
        return f"voxels lie {np.abs(index - whole).max():.3g} voxels off"
    error = np.abs(volume.values[tuple(whole.T)] - values.ravel()).max()
    if error > 1e-4 * np.abs(values).max():
        return f"values differ by {error:.3g}"
    return "" if np.linalg.det(volume.affine[:3, :3]) > 0 else "the grid is left-handed"


def by_nibabel(path: Path) -> Image:
    image: Any = nibabel.load(path)
    affine = image.affine * np.array(
        [[{"meter": 1e3, "micron": 1e-3}.get(image.header.get_xyzt_units()[0], 1)]] * 3 + [[1]]
    )
    return image.get_fdata().reshape(image.shape[:3]), affine


def by_simpleitk(path: Path) -> Image:
    """A file, or a folder with one DICOM series."""
    files = (
        sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(path), recursive=True)
        if path.is_dir()
        else str(path)
    )
    image = sitk.ReadImage(files)
    values = sitk.GetArrayFromImage(image).T
    axes = image.GetDimension()
    affine = np.eye(4)
    affine[:3, :3] = np.reshape(image.GetDirection(), (axes, axes))[:3, :3] * np.array(image.GetSpacing()[:3])
    affine[:3, 3] = image.GetOrigin()[:3]
    return values.reshape(values.shape[:3]), LPS_TO_RAS @ affine


INDEPENDENT: dict[str, tuple[Callable[[Path], Image], ...]] = {
    "NIfTI": (by_simpleitk,),
    "NRRD": (by_simpleitk,),
    "DICOM": (by_simpleitk,),
}


def oblique() -> Array:
    """Voxels of 0.5 x 0.6 x 0.8 mm, turned by 17 degrees about z."""
    c, s = np.cos(0.3), np.sin(0.3)
    affine = np.eye(4)
    affine[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) * [0.5, 0.6, 0.8]
    affine[:3, 3] = [-12, 7, 30]
    return affine


def grey() -> NDArray[np.int16]:
    return np.random.default_rng(0).integers(0, 900, (9, 8, 7)).astype(np.int16)


def grid() -> Volume:
    return Volume(grey().astype(np.float32), oblique())


def stored_as(codes: str, values: NDArray, affine: Array) -> Image:
    """The same image with its axes in another order, e.g. "LPS"."""
    target = nibabel.orientations.axcodes2ornt(codes)
    turn = nibabel.orientations.ornt_transform(nibabel.io_orientation(affine), target)
    turned = nibabel.apply_orientation(values, turn)
    return turned, affine @ nibabel.orientations.inv_ornt_aff(turn, values.shape)


def bent(affine: Array, axis: int, other: int, share: float) -> Array:
    """The affine with one axis sheared along another."""
    sheared = affine.copy()
    sheared[:3, axis] += share * affine[:3, other]
    return sheared


def drawn() -> Labels:
    labels = np.zeros(grey().shape, np.uint8)
    labels[2:4, 3:5, 2:4], labels[5:7, 3:5, 2:4], labels[0], labels[:, 0] = 1, 2, 255, 255
    return labels


def edited(path: Path, old: str, new: str) -> Path:
    """The file with a text of its header replaced; an empty `new` drops the line."""
    data = path.read_bytes()
    begin = data.index(old.encode())
    end = data.index(b"\n", begin) + (0 if new else 1)
    path.write_bytes(data[:begin] + new.encode() + data[end:])
    return path
