"""The lattice of an image's voxels: its storage order, its checks, and other images on the same lattice."""

from __future__ import annotations

from pathlib import Path

import nibabel
import numpy as np
from nibabel.orientations import apply_orientation, inv_ornt_aff, io_orientation
from numpy.typing import NDArray

from handpipe.core import Array, InputError
from handpipe.imaging.formats.stored import Stored

SPACING_RANGE = (0.02, 20.0)  # mm; a hand's voxels lie far inside
SKEW = 1e-3  # cosine between two axes: lengths measured by spacing alone are wrong by less than this share
SAME = 1e-2  # voxels: how far two equal grids may be apart


def to_ras(path: Path, stored: Stored) -> Stored:
    """The same image with its axes in the order and direction closest to RAS, which is right-handed.

    Parameters
    ----------
    path : Path
        File of the image, for messages.
    stored : Stored
        Image as its file stores it.

    Returns
    -------
    Stored
        Image with its axes exchanged and turned.

    Raises
    ------
    InputError
        If the axes are not finite, independent and at right angles, or voxels have the size of metres or
        micrometres.
    """
    _require_grid(path, stored.affine)
    return _reordered(stored, io_orientation(stored.affine))


def _reordered(stored: Stored, orientation: Array) -> Stored:
    """Axes permuted and flipped; row i of orientation: the new axis of the i-th, its direction 1 or -1."""
    values = apply_orientation(stored.values, orientation)
    return Stored(values, stored.affine @ inv_ornt_aff(orientation, stored.values.shape))


def _require_grid(path: Path, affine: Array) -> None:
    axes = affine[:3, :3]
    if not np.isfinite(affine).all() or not np.linalg.norm(axes, axis=0).all():
        raise InputError(path, "affine", "is singular or not finite", "Export it again with its orientation")
    spacing = np.linalg.norm(axes, axis=0)
    cosines = np.abs((axes / spacing).T @ (axes / spacing) - np.eye(3))
    if cosines.max() > SKEW:
        angle = np.degrees(np.arcsin(min(cosines.max(), 1.0)))
        problem = f"two axes are {angle:.2f} degrees off a right angle, as of a tilted gantry"
        raise InputError(path, "affine", problem, "Resample it to a grid of right angles")
    if spacing.min() < SPACING_RANGE[0] or spacing.max() > SPACING_RANGE[1]:
        guess = "metres" if spacing.min() < SPACING_RANGE[0] else "micrometres"
        problem = f"voxels of {_sizes(spacing)} mm; probably {guess}"
        raise InputError(path, "units", problem, "Write voxel sizes in mm")


def require_finite(path: Path, values: NDArray) -> None:
    """Raise `InputError` for values that float32 cannot hold."""
    if values.dtype.kind in "biu":
        return
    with np.errstate(over="ignore"):
        wrong = int((~np.isfinite(values.astype(np.float32))).sum())
    if wrong:
        problem = f"{wrong} voxels are NaN, infinite or beyond 3.4e38"
        raise InputError(path, "values", problem, "Replace them before import")


def on_grid(
    path: Path, stored: Stored, shape: tuple[int, int, int], affine: Array, part: bool = False
) -> NDArray:
    """An image's values on a grid, whatever order its own axes have.

    Parameters
    ----------
    path : Path
        File of the image, for messages.
    stored : Stored
        The image.
    shape : tuple of 3 ints
        Number of the grid's voxels along each axis.
    affine : array (4, 4)
        From the grid's voxel indices to world mm.
    part : bool
        Whether the image may cover a part of the grid only; values beyond it are 0.

    Returns
    -------
    array (nx, ny, nz)
        Values in the order of the grid's axes.

    Raises
    ------
    InputError
        If the lattices differ by more than a hundredth of a voxel at any corner, the extents differ (without
        `part`), or a value other than 0 lies beyond the grid.
    """
    to_index = np.linalg.inv(affine) @ stored.affine
    turn = np.rint(to_index[:3, :3])
    if not _is_reordering(turn):
        raise _mismatch(path, stored, shape, affine)
    orientation = np.array([[np.abs(c).argmax(), c[np.abs(c).argmax()]] for c in turn.T])
    moved = _reordered(stored, orientation)
    index = np.linalg.inv(affine) @ moved.affine
    lower = np.rint(index[:3, 3])
    error = np.abs(index[:3] - np.column_stack([np.eye(3), lower]))
    aligned = (error[:, :3] @ np.array(moved.values.shape) + error[:, 3] < SAME).all()
    whole = not lower.any() and moved.values.shape == shape
    if not aligned or not (whole or part):
        raise _mismatch(path, stored, shape, affine)
    return moved.values if whole else _pasted(path, moved.values, lower.astype(int), shape)


def _is_reordering(turn: Array) -> bool:
    """Whether a rounded matrix only permutes and flips axes."""
    return bool((np.abs(turn).sum(axis=0) == 1).all() and (np.abs(turn).sum(axis=1) == 1).all())


def _pasted(path: Path, values: NDArray, lower: NDArray, shape: tuple[int, int, int]) -> NDArray:
    """Values (a, b, c) put at the index `lower` of zeros of another shape."""
    upper = lower + values.shape
    first, last = np.maximum(lower, 0), np.minimum(upper, shape)
    whole = np.zeros(shape, values.dtype)
    if (first < last).all():
        inner = values[tuple(slice(*ends) for ends in zip(first - lower, last - lower, strict=True))]
        whole[tuple(slice(*ends) for ends in zip(first, last, strict=True))] = inner
    beyond = np.count_nonzero(values) - np.count_nonzero(whole)
    if beyond:
        problem = f"{beyond} labelled voxels lie beyond the volume"
        raise InputError(path, "grid", problem, "Give the segmentation of this volume")
    return whole


def _mismatch(path: Path, stored: Stored, shape: tuple[int, int, int], affine: Array) -> InputError:
    own = _described(stored.values.shape, stored.affine)
    problem = f"is not the volume's: {own}; the volume has {_described(shape, affine)}"
    return InputError(path, "grid", problem, "Draw the labels on the volume, or resample them to its grid")


def _described(shape: tuple[int, ...], affine: Array) -> str:
    """Size, spacing, axes and box of a grid, in words."""
    ends = np.array([np.zeros(3), np.array(shape) - 1]) @ affine[:3, :3].T + affine[:3, 3]
    first, last = (", ".join(f"{c:.4g}" for c in end) for end in ends)
    axes = "".join(a or "?" for a in nibabel.aff2axcodes(affine))
    voxels = " x ".join(map(str, shape))
    spacing = _sizes(np.linalg.norm(affine[:3, :3], axis=0))
    return f"{voxels} voxels of {spacing} mm, axes {axes}, from ({first}) to ({last})"


def _sizes(lengths: Array) -> str:
    return " x ".join(f"{s:g}" for s in lengths)
