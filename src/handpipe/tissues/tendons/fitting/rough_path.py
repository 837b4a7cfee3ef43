"""A tendon along a path that leaves it on the way, as a template's path on another person's bones may do."""

from __future__ import annotations

import logging

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial import cKDTree

from handpipe.core import Array
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance
from handpipe.tissues.tendons.fitting.extraction import SPACING, NeutralTendon, extract
from handpipe.tissues.tendons.rods.rod import arc_length, resample

log = logging.getLogger(__name__)

SEEN = 0.5  # mean confidence of sections that the image shows
WINDOW = 6.0  # mm along the rod of that mean, and length of an end that may be unseen
AIM = 8.0  # mm between points of the next path where the tendon is known
TRIES = 6  # extractions that move the rest of the path


def extract_roughly(
    volume: Volume, path: Array, radius: float, bones: Distance | None = None, spacing: float = SPACING
) -> NeutralTendon:
    """The rod, radii and surface of the dark tube that a rough path begins on.

    Where the image shows no tube along the rest of the path, that rest is moved to begin at the end of what
    it shows, and the tube is followed from there. Other parts are left out, with a warning.

    Parameters
    ----------
    volume : Volume
        The neutral image.
    path : array (k, 3)
        Points near the tendon in mm, the insertion first.
    radius : float
        Approximate radius in mm.
    bones : Distance, optional
        Distance to the whole bones (with cortex) in this image.
    spacing : float, optional
        Length of the rod's segments in mm.

    Returns
    -------
    NeutralTendon
        Rod, radii, confidence and surface. Where the image shows none of it, along the path as it is.

    Raises
    ------
    InputError
        Where a point lies outside the volume.
    """
    found = extract(volume, path, radius, bones, spacing)
    reached = _seen(found, spacing)
    for _ in range(TRIES):
        if reached == 0 or _left(found, reached) <= WINDOW:
            return found
        again = extract(volume, _aimed(volume, path, found.x[: reached + 1]), radius, bones, spacing)
        further = _seen(again, spacing)
        if arc_length(again.x)[further] <= arc_length(found.x)[reached] + WINDOW:
            break
        found, reached = again, further
    report = "the image shows the tendon for %.0f mm from its insertion; %.0f mm of its path are left out"
    log.warning(report, arc_length(found.x)[reached], _left(found, reached))
    return extract(volume, _thinned(found.x[: reached + 1]), radius, bones, spacing)


def _seen(found: NeutralTendon, spacing: float) -> int:
    """The last vertex that the image shows, 0 if it shows none."""
    near = uniform_filter1d(found.confidence, max(round(WINDOW / spacing), 1), mode="nearest")
    shown = np.flatnonzero((near >= SEEN) & (found.confidence >= SEEN))
    return int(shown[-1]) if len(shown) else 0


def _left(found: NeutralTendon, reached: int) -> float:
    """Length in mm beyond a vertex."""
    along = arc_length(found.x)
    return float(along[-1] - along[reached])


def _aimed(volume: Volume, path: Array, known: Array) -> Array:
    """What is known of a tendon, and the rest of the path moved to its end, as far as the volume goes."""
    dense = resample(path, SPACING)
    nearest = int(cKDTree(dense).query(known[-1])[1])
    rest = dense[nearest:] + known[-1] - dense[nearest]
    index = volume.to_index(rest)
    outside = ((index < 0) | (index > np.array(volume.shape) - 1)).any(axis=1)
    rest = rest[: int(np.argmax(outside))] if outside.any() else rest
    return np.vstack([_thinned(known), _thinned(rest)[1:]]) if len(rest) > 1 else _thinned(known)


def _thinned(points: Array) -> Array:
    """Some of a rod's points, some `AIM` mm apart, both ends among them."""
    count = max(round(arc_length(points)[-1] / AIM), 1) + 1
    return points[np.unique(np.linspace(0, len(points) - 1, count).round().astype(int))]
