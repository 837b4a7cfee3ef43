"""Marrow in a bone's own dark shell that the bone does not claim.

Where a canal is thinner than a voxel or the cortex separates the marrow, strokes in one end find that end
alone. A dark shell closes it all around, and nothing looks wrong. The missing end shows as bright tissue that
the same dark shell encloses, and that no other bone claims.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray, IntArray
from handpipe.imaging.segmentation.open_boundary import VALLEY
from handpipe.imaging.volumes.volume import box

BRIGHT = (0.4, 0.65)  # of the marrow's level: thresholds at which a shell may be closed
DIM = (
    0.4,
    0.45,
)  # of that level: thresholds for dim marrow, which a shell of half a voxel bounds as a valley
THICKEST = 2.0  # mm: wider valleys are tissues
RIM = 2  # voxels around a claim that its blurred boundary takes
FARTHEST = 25.0  # mm of solid bone between two parts of one marrow
AROUND = 2.0  # mm across a slim shaft
SOLID = 0.4  # of the marrow's level: the mean across a shaft without a canal, or with one of a voxel, is less
LEAST = 1.0  # mm^3: less is noise


class Unclaimed(NamedTuple):
    """The largest part that is left over: volume in mm^3, middle voxel (3,)."""

    volume: float
    middle: Array


NOTHING = Unclaimed(0.0, np.zeros(3))


class _Claim(NamedTuple):
    """What a bone claims (nx, ny, nz); the same with a rim; its voxels (m, 3), and their places as a tree."""

    voxels: BoolArray
    covered: BoolArray
    indices: IntArray
    places: cKDTree


def unclaimed_marrow(values: NDArray, claimed: BoolArray, others: BoolArray, spacing: NDArray) -> Unclaimed:
    """The largest bright part within a claim's shell that the claim lacks.

    Parameters
    ----------
    values : (nx, ny, nz)
        Intensities in units of the marrow's level. What reaches the border of the box is not enclosed.
    claimed, others : (nx, ny, nz) bool
        What the bone claims, and what other bones do.
    spacing : (3,)
        Of the voxels in mm.
    """
    covered = ndimage.binary_dilation(claimed, iterations=RIM)
    indices = np.argwhere(claimed)
    claim = _Claim(claimed, covered, indices, cKDTree(indices * spacing))
    found = [_largest(values, threshold, claim, others, spacing, beyond=True) for threshold in BRIGHT]
    shelled = np.where(_valleys(values, spacing) & ~claimed, 0, values)
    found += [_largest(shelled, threshold, claim, others, spacing, beyond=False) for threshold in DIM]
    return max(found, key=lambda part: part.volume)


def _largest(
    values: NDArray, threshold: float, claim: _Claim, others: BoolArray, spacing: NDArray, beyond: bool
) -> Unclaimed:
    """The largest part brighter than a threshold that holds claimed voxels.

    beyond: also one that solid bone joins to the claim.
    """
    parts, count = ndimage.label(values > threshold)
    enclosed = np.ones(count + 1, bool)
    enclosed[0] = False
    enclosed[parts[others]] = False
    for axis in range(3):
        for end in (0, -1):
            enclosed[np.take(parts, end, axis)] = False
    sizes = np.bincount(parts[~claim.covered].ravel(), minlength=count + 1) * enclosed
    voxel = float(np.prod(spacing))
    own = np.zeros(count + 1, bool)
    own[parts[claim.voxels]] = True
    boxes = ndimage.find_objects(parts)
    for part in np.argsort(-sizes)[:5]:
        if sizes[part] * voxel < LEAST:
            break
        around = boxes[part - 1]
        rest = np.argwhere((parts[around] == part) & ~claim.covered[around]) + [s.start for s in around]
        if own[part] or (beyond and _joined(values, claim, rest, spacing)):
            return Unclaimed(float(sizes[part]) * voxel, rest.mean(axis=0))
    return NOTHING


def _valleys(values: NDArray, spacing: NDArray) -> BoolArray:
    """Voxels that are darker along an axis than both sides of them within `THICKEST`."""
    found = np.zeros(values.shape, bool)
    for axis in range(3):
        size = [1, 1, 1]
        size[axis] = int(round(THICKEST / spacing[axis])) + 1
        found |= ndimage.grey_closing(values, size=size) - values > VALLEY
    return found


def _joined(values: NDArray, claim: _Claim, rest: NDArray, spacing: NDArray) -> bool:
    """Whether a part's voxels (m, 3) and the claim are the ends of one solid piece of bone.

    Half-way between them, and all the way but near the ends, it is dark for `AROUND` mm across: a joint's
    cartilage is not, a canal of a voxel is.
    """
    distances, nearest = claim.places.query(rest * spacing)
    at = int(np.argmin(distances))
    start, end, length = rest[at], claim.indices[nearest[at]], float(distances[at])
    if length > FARTHEST:
        return False
    near = min(AROUND / max(length, AROUND), 0.5)
    share = np.linspace(near, 1 - near, 2 * int(np.abs(end - start).max()) + 1)[:, None]
    way = np.round(start + share * (end - start)).astype(int)
    across = np.maximum(np.round(AROUND / spacing), 1).astype(int)
    low = np.maximum(way.min(axis=0) - across, 0)
    beside = values[box(low, way.max(axis=0) + across + 1)]
    return bool((ndimage.uniform_filter(beside, across)[tuple((way - low).T)] < SOLID).all())
