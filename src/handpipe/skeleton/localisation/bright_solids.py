"""Bright solids in dark shells: what may be the marrow of some bone, before anything is known of the hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import ndimage

from handpipe.core import Array, BoolArray, IntArray
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface

THRESHOLDS = (
    0.5,
    0.55,
    0.6,
    0.65,
    0.7,
    0.75,
    0.8,
)  # levels: high ones part marrows whose shells are thin
VOLUMES = (12.0, 14000.0)  # mm^3, from a small distal phalanx's marrow to a large metacarpal's
SHELL = 1.2  # mm from a marrow's boundary within which its shell is darkest
DARK = 0.4  # levels: cortex, blurred by the voxel; muscle is as bright
ENCLOSED = 0.5  # of a solid's boundary, at least, has a dark shell
SAME = 0.85  # of the voxels that two solids share, of both
NEAR = 3.0  # mm between the middles of solids that are compared
SLIM = 2.2  # length by width of a bone that has a direction
END = 0.08  # of a solid's length: its ends are the means of as much
PLACES = 500  # of a solid that are kept in mm
SAMPLES = 6000  # of a surface's inside
FEWEST = 50  # samples deep inside a surface; with fewer, all inside it count


@dataclass(frozen=True)
class SolidShape:
    """Ends and size of a solid.

    Parameters
    ----------
    ends : array (2, 3)
        Its ends along its long axis in mm.
    length : float
        Its extent along that axis in mm.
    width : float
        Twice the deviation of its points from that axis, in mm.
    volume : float
        Its volume in mm^3.
    """

    ends: Array
    length: float
    width: float
    volume: float

    @staticmethod
    def fit(points: Array, volume: float) -> SolidShape:
        """From points (n, 3) that fill it."""
        middle = points.mean(axis=0)
        axis = np.linalg.eigh(np.cov((points - middle).T))[1][:, -1]
        along = (points - middle) @ axis
        across = np.linalg.norm(points - middle - along[:, None] * axis, axis=1)
        low, high = float(along.min()), float(along.max())
        rim = END * (high - low)
        ends = [points[along <= low + rim].mean(axis=0), points[along >= high - rim].mean(axis=0)]
        return SolidShape(np.array(ends), high - low, 2 * float(np.sqrt((across**2).mean())), volume)

    @staticmethod
    def inside(surface: Surface, depth: float) -> SolidShape:
        """Of what a closed surface encloses at least `depth` mm below it."""
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        points = np.random.default_rng(0).uniform(low, high, (SAMPLES, 3))
        signed = Distance(surface).signed(points)[0]
        kept = points[signed < -depth] if (signed < -depth).sum() > FEWEST else points[signed < 0]
        return SolidShape.fit(kept, float(np.prod(high - low)) * len(kept) / SAMPLES)

    @property
    def slim(self) -> bool:
        """Whether it is long enough to have a direction."""
        return self.length > SLIM * self.width

    @property
    def middle(self) -> Array:
        """Half-way between its ends (3,)."""
        return np.asarray(self.ends.mean(axis=0))


@dataclass(frozen=True)
class BrightSolid:
    """A connected bright part of an image.

    Parameters
    ----------
    voxels : array (n, 3) of int
        Its voxels.
    shape : SolidShape
        Its ends and size.
    enclosed : float
        Share of its boundary that has a dark shell.
    places : array (m, 3)
        Some of its voxels' centres in mm.
    """

    voxels: IntArray
    shape: SolidShape
    enclosed: float
    places: Array


def find_solids(normalised: Volume) -> list[BrightSolid]:
    """The connected bright parts of an image that have a bone's size and a dark shell.

    Parts of several thresholds may be parts of one another; of nearly equal ones the best enclosed is kept.

    Parameters
    ----------
    normalised : Volume
        Image in units of the local marrow level.

    Returns
    -------
    list of BrightSolid
        Best enclosed first.
    """
    size = 2 * np.ceil(SHELL / normalised.spacing).astype(int) + 1
    shell = ndimage.minimum_filter(normalised.values, tuple(size)) < DARK
    kept: list[tuple[BrightSolid, IntArray]] = []
    for solid in sorted(_solids(normalised, shell), key=lambda s: -s.enclosed):
        flat = np.ravel_multi_index(tuple(solid.voxels.T), normalised.shape)
        if not any(_same(solid, flat, other, known) for other, known in kept):
            kept.append((solid, flat))
    return [solid for solid, _ in kept]


def _solids(normalised: Volume, shell: BoolArray) -> Iterator[BrightSolid]:
    """Connected parts above each threshold, as they are and parted where they touch by few voxels."""
    voxel = float(np.prod(normalised.spacing))
    least, most = (volume / voxel for volume in VOLUMES)
    for threshold, worn in product(THRESHOLDS, (False, True)):
        mask = normalised.values > threshold
        parts, _ = ndimage.label(ndimage.binary_erosion(mask) if worn else mask)
        sizes = np.bincount(parts.ravel())
        sizes[0] = 0
        boxes = ndimage.find_objects(parts)
        for number in np.flatnonzero((sizes > least / (1 + worn)) & (sizes < most)):
            low = np.array([max(s.start - 2, 0) for s in boxes[number - 1]])
            region = tuple(slice(a, s.stop + 2) for a, s in zip(low, boxes[number - 1], strict=True))
            own = parts[region] == number
            if worn:
                own = ndimage.binary_dilation(own) & mask[region]
            rim = ndimage.binary_dilation(own) & ~own
            enclosed = float(shell[region][rim].mean())
            if enclosed >= ENCLOSED:
                voxels = np.argwhere(own) + low
                places = normalised.to_world(voxels)
                shape = SolidShape.fit(places, len(voxels) * voxel)
                yield BrightSolid(voxels, shape, enclosed, places[:: max(len(places) // PLACES, 1)])


def _same(solid: BrightSolid, flat: IntArray, other: BrightSolid, known: IntArray) -> bool:
    """Whether two solids share most of their voxels, given by their numbers in the image."""
    if np.linalg.norm(solid.shape.middle - other.shape.middle) > NEAR:
        return False
    larger = max(len(flat), len(known))
    if min(len(flat), len(known)) < SAME * larger:
        return False
    return len(np.intersect1d(flat, known, assume_unique=True)) > SAME * larger
