"""Where the root's bones are in an image, wherever the hand lies: starts from bright blobs of their size."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.localisation.motion_search import Motions

LOG = logging.getLogger(__name__)

THRESHOLDS = (0.55, 0.7)  # levels: marrow is above; where shells are thin a higher one separates marrows
ROLLS = 36  # trials about a bone's axis
SHIFTS = (-3.0, 0.0, 3.0)  # mm along the bone: a blob may lack an end, or have a neighbour's
ALIKE = (0.25, 0.45, 0.45)  # logarithm of the ratio of lengths, along the three axes
LONG = 1.8  # length by width of a bone that has a direction
VOLUMES = (0.4, 2.5)  # of the least and of the largest long bone: volumes of blobs


@dataclass(frozen=True)
class Blob:
    """Centre and principal axes of a solid.

    Parameters
    ----------
    centre : array (3,)
        Centre in mm.
    axes : array (3, 3)
        Principal axes in columns, right-handed, the long one first.
    lengths : array (3,)
        Standard deviations along the axes in mm.
    """

    centre: Array
    axes: Array
    lengths: Array

    @staticmethod
    def fit(points: Array) -> Blob:
        """From points (n, 3) that fill it."""
        centre = points.mean(axis=0)
        values, axes = np.linalg.eigh(np.cov(points.T))
        axes = axes[:, ::-1] * [1, 1, np.sign(np.linalg.det(axes[:, ::-1]))]
        return Blob(centre, axes, np.sqrt(np.maximum(values[::-1], 1e-6)))

    def alike(self, other: Blob) -> bool:
        """Whether both have the same size and proportions."""
        return bool((np.abs(np.log(self.lengths / other.lengths)) < ALIKE).all())


def solid(surface: Surface, count: int = 6000) -> Blob:
    """The blob that a closed surface encloses."""
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    points = np.random.default_rng(0).uniform(low, high, (count, 3))
    return Blob.fit(points[Distance(surface).signed(points)[0] < 0])


def root_starts(evidence: MarrowEvidence, marrow: Mapping[str, Surface]) -> Iterator[Motions]:
    """Motions that carry one of the root's bones onto a blob of its size, either way round and rolled.

    One set after another, each from other ways to tell blobs apart; rest is in all of them.
    """
    bones = {name: solid(surface) for name, surface in marrow.items()}
    long = {n: b for n, b in bones.items() if b.lengths[0] > LONG * b.lengths[1]} or bones
    volumes = [marrow[n].volume() for n in long]
    for blobs in _bright_blobs(evidence.fine, VOLUMES[0] * min(volumes), VOLUMES[1] * max(volumes)):
        starts = [RigidTransform.identity()]
        for blob, bone in product(blobs, long.values()):
            starts += _onto(bone, blob) if bone.alike(blob) else []
        LOG.info("root: %d bright blobs, %d starts", len(blobs), len(starts))
        yield Motions.stack(starts)


def _bright_blobs(image: Volume, least: float, most: float) -> Iterator[list[Blob]]:
    """Connected bright parts of `least` to `most` mm^3, as they are and without their outer voxels."""
    voxel = float(np.prod(image.spacing))
    for threshold, worn in product(THRESHOLDS, (False, True)):
        mask = image.values > threshold
        parts, _ = ndimage.label(ndimage.binary_erosion(mask) if worn else mask)
        sizes = np.bincount(parts.ravel()) * voxel
        sizes[0] = 0
        boxes = ndimage.find_objects(parts)
        found = []
        for number in np.flatnonzero((sizes > least / (1 + worn)) & (sizes < most)):
            box = boxes[number - 1]
            own = np.argwhere(parts[box] == number) + [s.start for s in box]
            found.append(Blob.fit(image.to_world(own)))
        yield found


def _onto(bone: Blob, blob: Blob) -> list[RigidTransform]:
    """Long axis on long axis, either way round, rolled about it and shifted along it."""
    starts = []
    for flip in (np.eye(3), np.diag([-1.0, -1.0, 1.0])):
        for roll in np.linspace(0, 2 * np.pi, ROLLS, endpoint=False):
            turn = Rotation.from_rotvec([roll, 0, 0]).as_matrix() @ flip
            rotation = blob.axes @ turn @ bone.axes.T
            for shift in SHIFTS:
                target = blob.centre + shift * blob.axes[:, 0]
                starts.append(RigidTransform(rotation, target - rotation @ bone.centre))
    return starts
