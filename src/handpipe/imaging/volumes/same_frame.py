"""Whether data that a person gives are in the right frame and unit; if not, the likely cause.

One test for scans, marks and templates: how well something fits its reference as it is, and how well it
would fit after each of the usual mistakes is undone (units, LPS for RAS, mirrored or exchanged axes).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from skimage.filters import threshold_li

from handpipe.core import Array, BoolArray, InputError
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface

Fit = Callable[[Array], float]

log = logging.getLogger(__name__)

GRID = 2.5  # mm between the points at which scan and image are compared
AIR = 0.15  # of bright tissue: what is darker in an image with air around the body
# Dice coefficient of a scan's inside with the image's foreground. Generated hands have 0.94 in their own pose
# and 0.42 to 0.67 in another; real scans fit less well, as skin and coil move.
REFUSED, DOUBTED = 0.6, 0.8
CLEARLY = 0.15  # by which another frame or pose must fit better to be the cause
BEYOND = 8.0  # mm from the body at which a point is not in the image's frame
SMALLEST = 1.0  # mm across all points: fewer are no points of an organ

ORGANS = (2.0, 600.0)  # mm across an organ, from the smallest ligament to a forearm
UNITS = {"centimetres": 10.0, "metres": 1000.0, "inches": 25.4, "micrometres": 0.001}
_AXES = {
    "LPS, not RAS (turn the signs of x and y)": np.diag([-1.0, -1.0, 1.0]),
    "y up (exchange y and z)": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "y down (exchange y and z)": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "mirrored in x": np.diag([-1.0, 1.0, 1.0]),
    "mirrored in y": np.diag([1.0, -1.0, 1.0]),
    "mirrored in z": np.diag([1.0, 1.0, -1.0]),
}
# What may be wrong, with the matrix (3, 3) that corrects it.
CAUSES: dict[str, Array] = {
    **_AXES,
    **{f"{unit} (scale by {factor:g})": factor * np.eye(3) for unit, factor in UNITS.items()},
    **{
        f"{unit} (scale by {factor:g}) and {axes}": factor * matrix
        for unit, factor in UNITS.items()
        for axes, matrix in list(_AXES.items())[:3]
    },
}
RATIO = (0.6, 1.7)  # of sizes in two units that may be the same length
AIR_QUANTILE, BRIGHT_QUANTILE = 0.05, 0.98  # of an image with air around
EXPLAINED = 0.99  # share of the points that a cause has to explain


def likely_cause(fit: Fit, least: float = EXPLAINED) -> str | None:
    """The mistake in frame or unit that explains a bad fit best.

    Parameters
    ----------
    fit : callable
        How well something fits its reference after a matrix (3, 3) is applied to it; more is better.
    least : float
        Smallest fit that explains anything.

    Returns
    -------
    str or None
        One of the keys of `CAUSES`. None if no matrix of `CAUSES` gives a fit of at least `least`.
    """
    fits = {cause: fit(matrix) for cause, matrix in CAUSES.items()}
    best = max(fits, key=lambda cause: fits[cause])
    return best if fits[best] >= least else None


def unit_of(ratio: float, size: float) -> str | None:
    """The unit in which something is probably given that is too large or too small.

    Parameters
    ----------
    ratio : float
        Its size over the size that it should have.
    size : float
        Its size as it stands, read as mm. After conversion it must be the size of an organ.

    Returns
    -------
    str or None
        The unit and the factor that converts it to mm. None if no unit explains the ratio.
    """
    for unit, factor in UNITS.items():
        if RATIO[0] < ratio * factor < RATIO[1] and ORGANS[0] < size * factor < ORGANS[1]:
            return f"{unit}: scale by {factor:g}"
    return None


@dataclass(frozen=True)
class Foreground:
    """Which places of an image are in the body.

    Parameters
    ----------
    points : array (n, 3)
        Places in the image, in world mm.
    body : array (n,) of bool
        Whether each place is in the body.
    """

    points: Array
    body: BoolArray

    @staticmethod
    def threshold(volume: Volume) -> Foreground:
        """What is brighter than Li's threshold (Li and Tam 1998); everything where there is no air around."""
        steps = np.maximum(np.round(GRID / volume.spacing).astype(int), 1)
        values = volume.values[:: steps[0], :: steps[1], :: steps[2]]
        indices = steps * np.moveaxis(np.indices(values.shape), 0, -1).reshape(-1, 3)
        flat = values.reshape(-1).astype(np.float64)
        has_air = bool(np.quantile(flat, AIR_QUANTILE) < AIR * np.quantile(flat, BRIGHT_QUANTILE))
        body = flat > threshold_li(flat) if has_air else np.ones(len(flat), dtype=bool)
        return Foreground(volume.to_world(indices), body)

    @cached_property
    def box(self) -> Array:
        """Lower and upper corner (2, 3) of the image."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points[self.body])

    def distances(self, points: Array) -> Array:
        """Distances (k,) in mm of points (k, 3) from the nearest place in the body."""
        return np.asarray(self._tree.query(points)[0])

    def agreement(self, scan: Surface, matrix: Array | None = None) -> float:
        """Dice coefficient of the body and the inside of the scan, moved by a matrix (3, 3)."""
        points = self.points if matrix is None else self.points @ np.linalg.inv(matrix).T
        inside = scan.contains(points)
        both, either = int((inside & self.body).sum()), int(inside.sum() + self.body.sum())
        return 2.0 * both / max(either, 1)


def fits_clearly(agreement: float, before: float = 0.0) -> bool:
    """Whether a scan fits an image beyond doubt.

    Parameters
    ----------
    agreement : float
        Dice coefficient of the scan's inside and the body in the image.
    before : float
        That of another place or another pose's image, which the scan has to fit clearly less well.

    Returns
    -------
    bool
        False from the limit on below which a warning names the scan.
    """
    return agreement >= max(before + CLEARLY, DOUBTED)


def require_scan_in_image(
    path: str | Path, scan: Surface, image: Foreground, others: Mapping[str, Callable[[], Foreground]]
) -> float:
    """The agreement of a scan with the image of its pose.

    Parameters
    ----------
    path : str or Path
        File of the scan, for messages.
    scan : Surface
        Closed surface of the skin in mm. It may face inwards.
    image : Foreground
        Body in the image of the scan's pose.
    others : mapping of str to callable
        Makes the foreground of each other pose. Called only if the scan fits its own image badly.

    Returns
    -------
    float
        Dice coefficient of the scan's inside and the body in the image.

    Raises
    ------
    InputError
        If the scan does not fit the image, or fits clearly better after one of `CAUSES` is corrected, or with
        the image of another pose. The message names the likely cause.
    """
    scan = scan if scan.volume() > 0 else scan.flipped()
    own = image.agreement(scan)
    if fits_clearly(own):
        return own
    fits = {pose: make().agreement(scan) for pose, make in others.items()}
    better = max(fits, key=lambda pose: fits[pose], default="")
    cause = likely_cause(lambda matrix: image.agreement(scan, matrix), own + CLEARLY)
    problem = f"overlaps the body in the pose's image by a Dice coefficient of {own:.2f} only"
    if better and fits_clearly(fits[better], own):
        remedy = f"It fits the image of pose {better!r} ({fits[better]:.2f}): are the files exchanged?"
    elif cause is not None:
        remedy = (
            f"It would fit if it is in {cause}" if "mirrored" not in cause else f"It would fit if {cause}"
        )
    elif own < REFUSED:
        boxes = _boxes(scan.compact().vertices, image.box)
        remedy = f"{boxes}. Give it in RAS mm in the image's frame and pose, or write scan_frame: own"
    else:
        log.warning("%s: %s; is it of this pose?", path, problem)
        return own
    raise InputError(path, "frame", problem, remedy)


def require_points_in_image(
    path: str | Path, points: Array, labels: list[str], image: Foreground, where: str
) -> None:
    """Check that points lie in or near the body in an image.

    Parameters
    ----------
    path : str or Path
        File of the points, for messages.
    points : array (k, 3)
        Points in mm.
    labels : list of str
        Label of each point; a point with an empty label is named by its number.
    image : Foreground
        Body in the image.
    where : str
        Name of the image, for messages.

    Raises
    ------
    InputError
        If a point is more than `BEYOND` mm from the body. The message names the likely cause.
    """
    distances = image.distances(points)
    bad = np.flatnonzero(distances > BEYOND)
    if len(bad) == 0:
        return

    def inside(matrix: Array) -> float:
        moved = points @ matrix.T
        large = len(points) < 2 or np.ptp(moved, axis=0).max() >= SMALLEST
        return float((image.distances(moved) <= BEYOND).mean()) if large else 0.0

    first = labels[bad[0]] or str(bad[0])
    problem = f"{len(bad)} of {len(points)} points are outside the body in {where}, "
    problem += f"{first!r} by {distances[bad[0]]:.0f} mm"
    cause = likely_cause(inside) if len(bad) > len(points) // 2 else None
    remedy = f"They would fit if they are in {cause}" if cause else f"{_boxes(points, image.box)}. Place them"
    raise InputError(path, "points", problem, remedy)


def _boxes(points: Array, box: Array) -> str:
    return f"Its box is {_box(points.min(axis=0), points.max(axis=0))}, the image's {_box(*box)}"


def _box(lower: Array, upper: Array) -> str:
    return " x ".join(f"[{a:.0f}, {b:.0f}]" for a, b in zip(lower, upper, strict=True))
