"""A DICOM series as one regular grid, or the reason why it is none.

Headers say where each image lies; GDCM (through SimpleITK) decodes and rescales the pixels.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from math import prod
from pathlib import Path

import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray

from handpipe.core import Array, InputError
from handpipe.imaging.formats.dicom_frames import DicomFrame, frames_of
from handpipe.imaging.formats.stored import LPS_TO_RAS, Stored, reading, require_size

log = logging.getLogger(__name__)

ALIKE = 1e-3  # 1 and mm: difference of directions (cosines) and of pixel sizes that is rounding
SAME_PLACE = 1e-3  # mm
AGREEMENT = 0.05  # voxels: how far an image may lie from its place on the grid


def read_dicom(path: Path, series: int | str | None = None, echo: int | None = None) -> Stored:
    """Read one series of a file or of all files under a folder.

    Parameters
    ----------
    series : int or str, optional
        Number, description or UID of the series where there are several.
    echo : int, optional
        Which of several echoes, counted from 1 in the order of echo times.

    Raises
    ------
    InputError
        If the images are not one regular grid: several series, echoes or orientations, missing or repeated
        images, images of several sizes; if they are phases or colours; if a file is damaged.
    """
    frames = _of_series(path, frames_of(path), series)
    frames = _of_echo(path, _magnitudes(path, _without_copies(frames)), echo)
    _require_alike(path, frames)
    _require_one_scale(frames)
    frames, affine = _on_grid(path, frames)
    rows, columns = frames[0].size
    require_size(path, prod((rows, columns, len(frames))), 4, 0, np.inf)
    return Stored(_pixels(frames), LPS_TO_RAS @ affine)


def _of_series(path: Path, frames: list[DicomFrame], series: int | str | None) -> list[DicomFrame]:
    """The frames of the series that is asked for, or of the only one whose images have a place."""
    placed = {f.series_uid for f in frames if f.position is not None}
    found: dict[str, list[DicomFrame]] = {}
    for frame in frames:
        if frame.series_uid in placed:
            found.setdefault(frame.series_uid, []).append(frame)
    if not found:
        problem = f"holds {len(frames)} DICOM images, none with a place in space and a pixel size"
        raise InputError(path, "volume", problem, "Give a folder with the images of one MR series")
    listed = "; ".join(f"{of[0].series}, {len(of)} images" for of in found.values())
    if series is not None:
        wanted = str(series).strip()
        found = {
            uid: of
            for uid, of in found.items()
            if wanted in (of[0].series_number, of[0].description, of[0].series_uid)
        }
        if len(found) != 1:
            problem = f"{len(found)} have the number, description or UID {wanted!r}; there are {listed}"
            raise InputError(path, "series", problem, "Name one by its number or UID")
    if len(found) != 1:
        problem = f"holds {len(found)} DICOM series: {listed}"
        raise InputError(path, "volume", problem, "Choose one by `series` in the dataset file")
    return next(iter(found.values()))


def _without_copies(frames: list[DicomFrame]) -> list[DicomFrame]:
    """Each image once, though a file may have been copied within its folder."""
    found: dict[Hashable, DicomFrame] = {}
    for f in frames:
        place = None if f.position is None else f.position.tobytes()
        found.setdefault((f.uid or f.file, f.number, place), f)
    return list(found.values())


def _magnitudes(path: Path, frames: list[DicomFrame]) -> list[DicomFrame]:
    kept = [f for f in frames if not f.component]
    left = sorted({f.component for f in frames if f.component})
    if not kept:
        problem = f"series {frames[0].series} holds {' and '.join(left)} images alone"
        raise InputError(path, "values", problem, "Give the magnitude images")
    if left:
        log.warning("%s: %s images are left out: %d", path, " and ".join(left), len(frames) - len(kept))
    return kept


def _of_echo(path: Path, frames: list[DicomFrame], echo: int | None) -> list[DicomFrame]:
    times = sorted({_echo_time(f) for f in frames})
    listed = ", ".join(f"{t:g}" for t in times)
    if echo is None and len(times) > 1:
        problem = f"series {frames[0].series} has {len(times)} echoes ({listed} ms)"
        raise InputError(path, "echo", problem, "Choose one by `echo` in the dataset file: 1 is the first")
    if echo is not None and not 1 <= echo <= len(times):
        problem = f"is {echo}; series {frames[0].series} has {len(times)} ({listed} ms)"
        raise InputError(path, "echo", problem, f"Give 1 to {len(times)}")
    return [f for f in frames if _echo_time(f) == times[(echo or 1) - 1]]


def _echo_time(frame: DicomFrame) -> float:
    """In ms, rounded as scanners round it."""
    return 0.0 if frame.echo_time is None else round(frame.echo_time, 2)


def _require_alike(path: Path, frames: list[DicomFrame]) -> None:
    """Raise `InputError` for images that cannot be slices of one grid."""
    unplaced = [f.file.name for f in frames if f.position is None]
    if unplaced:
        problem = f"{len(unplaced)} images have no place in space or no pixel size ({unplaced[0]})"
        raise InputError(path, "slices", problem, "Export the series again")
    if any(f.mosaic for f in frames):
        raise InputError(path, "slices", "are tiles of mosaics", "Convert the series to NIfTI")
    photometric = {f.photometric for f in frames} - {"MONOCHROME2"}
    if photometric:
        remedy = "Convert it to MONOCHROME2, where bright tissue has high values"
        raise InputError(path, "values", f"are {', '.join(sorted(photometric))}", remedy)

    def several(of: Callable[[DicomFrame], Hashable]) -> list[str]:
        found = sorted({str(of(f)) for f in frames})
        return found if len(found) > 1 else []

    separate = "Choose one by `series` in the dataset file, or give a folder of one series"
    turned = [f for f in frames if np.abs(f.orientation - frames[0].orientation).max() > ALIKE]
    if turned:
        problem = f"{len(turned)} of {len(frames)} images lie in other planes, as a localiser's do"
        raise InputError(path, "slices", problem, separate)
    if sizes := several(lambda f: " x ".join(map(str, f.size))):
        raise InputError(path, "slices", f"have {' and '.join(sizes)} pixels", separate)
    if any(np.abs(f.spacing - frames[0].spacing).max() > ALIKE for f in frames):
        spacings = several(lambda f: " x ".join(f"{s:g}" for s in f.spacing))
        raise InputError(path, "slices", f"have pixels of {' and '.join(spacings)} mm", separate)
    if several(lambda f: f.reference):
        raise InputError(path, "slices", "have several frames of reference", separate)


def _require_one_scale(frames: list[DicomFrame]) -> None:
    """Raise `InputError` for a file whose frames have several slopes: its reader has one for all."""
    scales: dict[Path, set[tuple[float, float]]] = {}
    for f in frames:
        scales.setdefault(f.file, set()).add((f.slope, f.intercept))
    for file, of in scales.items():
        if len(of) > 1:
            problem = f"frames have {len(of)} slopes or intercepts"
            raise InputError(file, "values", problem, "Export it as one image a file")


def _on_grid(path: Path, frames: list[DicomFrame]) -> tuple[list[DicomFrame], Array]:
    """The frames in order along their normal, and the affine from (column, row, slice) to LPS mm."""
    if len(frames) < 2:
        problem = "is one slice, not a 3D volume"
        raise InputError(path, "shape", problem, "Give the folder with all slices of the series")
    along_row, along_column = frames[0].orientation
    normal = np.cross(along_row, along_column)
    if np.abs(frames[0].orientation @ frames[0].orientation.T - np.eye(2)).max() > ALIKE:
        problem = "directions of rows and columns are not perpendicular unit vectors"
        raise InputError(path, "orientation", problem, "Export the series again")
    frames = sorted(frames, key=lambda f: float(_placed(f) @ normal))
    positions = np.array([_placed(f) for f in frames])
    _require_regular(path, frames, positions, positions @ normal)
    affine = np.eye(4)
    affine[:3, 0] = along_row * frames[0].spacing[1]
    affine[:3, 1] = along_column * frames[0].spacing[0]
    affine[:3, 2] = (positions[-1] - positions[0]) / (len(frames) - 1)
    affine[:3, 3] = positions[0]
    return frames, affine


def _placed(frame: DicomFrame) -> Array:
    assert frame.position is not None
    return frame.position


def _require_regular(path: Path, frames: list[DicomFrame], positions: Array, along: Array) -> None:
    """Raise `InputError` where slices repeat, are missing, or lie beside their places on the grid."""
    steps = np.diff(along)
    same = np.flatnonzero(steps < SAME_PLACE)
    if len(same):
        one, other = frames[same[0]], frames[same[0] + 1]
        problem = f"{len(same)} lie where another one does ({_named(one)} and {_named(other)})"
        raise InputError(path, "slices", problem, "Give one image a place: one echo, time or contrast")
    step = float(np.median(steps))
    gap = int(steps.argmax())
    if steps[gap] > 1.5 * step:
        problem = (
            f"{round(steps[gap] / step) - 1} missing between {_named(frames[gap])} and "
            f"{_named(frames[gap + 1])}: {steps[gap]:.4g} mm apart, elsewhere {step:.4g} mm"
        )
        raise InputError(path, "slices", problem, "Export the whole series")
    even = positions[0] + np.linspace(0, 1, len(positions))[:, None] * (positions[-1] - positions[0])
    off = np.linalg.norm(positions - even, axis=1)
    if off.max() > AGREEMENT * min(step, *frames[0].spacing):
        problem = (
            f"{_named(frames[int(off.argmax())])} lies {off.max():.3g} mm beside an even grid; "
            f"slices are {steps.min():.4g} to {steps.max():.4g} mm apart"
        )
        raise InputError(path, "slices", problem, "Resample them to an even grid")


def _named(frame: DicomFrame) -> str:
    return frame.file.name if frame.number == 0 else f"{frame.file.name} frame {frame.number + 1}"


def _pixels(frames: list[DicomFrame]) -> NDArray[np.float32]:
    """Values (columns, rows, slices), rescaled to what the scanner meant."""
    rows, columns = frames[0].size
    values = np.empty((columns, rows, len(frames)), np.float32)
    for file in dict.fromkeys(f.file for f in frames):
        with reading(file, "DICOM"):
            stack = sitk.GetArrayFromImage(sitk.ReadImage(str(file), imageIO="GDCMImageIO"))
            stack = stack.reshape(-1, rows, columns)
            for k, frame in enumerate(frames):
                if frame.file == file:
                    values[:, :, k] = stack[frame.number].T
    return values
