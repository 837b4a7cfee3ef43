"""All bones and the background compete for the voxels: random walkers with priors (Grady 2005).

The first walker shares the voxels between bone and background. Its edges are weak where the image or the
learned look changes, and each voxel is pulled towards its look's probability. Then one walker per bone shares
what is bone among the bones; its edges are weak besides where little is bone, as in cartilage.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array, BoolArray
from handpipe.imaging.learned.share import BoneShare, tidied
from handpipe.imaging.segmentation import BACKGROUND, Stop, harmonic
from handpipe.imaging.volumes import Labels

CONTRAST = 6.0  # weight of squared differences of relative intensities, and of the look, along an edge
PRIOR = 0.03  # of a voxel's own look, against an edge without contrast
APART = 4  # power of the share of bone that an edge between bones has
LEAST_BONE = 0.1  # that this power is taken of
MINIMUM_WEIGHT = 1e-4  # of an edge
REACH = 12.0  # mm around a bone's strokes in which its walker walks
STOP = Stop(tolerance=1e-2, undecided=5e-4)  # where the walker's iterations end


def compete(
    images: NDArray, look: NDArray, seeds: Labels, spacing: Array, bones: Mapping[str, int]
) -> dict[str, BoneShare]:
    """Each bone's share of the voxels; no voxel belongs to two bones.

    Parameters
    ----------
    images : array (c, nx, ny, nz)
        Relative intensities of the channels.
    look : array (nx, ny, nz)
        Learned probability of being bone.
    seeds : array (nx, ny, nz) of uint8
        Strokes: 0 for none, labels of bones, 255 for the background.
    spacing : array (3,)
        Size of a voxel in mm.
    bones : mapping of str to int
        Label of each bone that has strokes.

    Returns
    -------
    dict of str to BoneShare
        Share of each bone by name, in one part without holes.

    Raises
    ------
    ConvergenceError
        If a random walker does not converge.
    """
    inside = (seeds > 0) & (seeds < BACKGROUND)
    bone = balanced(edge_weights(images, spacing, look), seeds > 0, inside, PRIOR, look)
    between = edge_weights(images, spacing) * _least_of_both(np.maximum(bone, LEAST_BONE) ** APART)
    shares: dict[str, BoneShare] = {}
    total = np.zeros(seeds.shape)
    for name, label in bones.items():
        region = _around(seeds == label, REACH / spacing)
        edges, own = between[(slice(None), *region)], seeds[region] == label
        part = balanced(edges, inside[region], own, 0.0, np.zeros(own.shape))
        shares[name] = BoneShare(label, region, part)
        total[region] += part
    for share in shares.values():
        share.values *= bone[share.region] / np.maximum(total[share.region], 1e-6)
    return tidied(shares, seeds)


def edge_weights(images: NDArray, spacing: Array, look: NDArray | None = None) -> Array:
    """Weights (3, nx, ny, nz) of the edges from each voxel to its next; the last ones lead nowhere.

    An edge has exp(-CONTRAST change^2) over its squared length, where change^2 is the mean over the images
    (c, nx, ny, nz) of their squared differences, and that of the look besides.
    """
    out = np.zeros((3, *images.shape[1:]))
    conductance = (spacing.min() / spacing) ** 2
    for axis in range(3):
        change = np.mean(np.diff(images, axis=axis + 1) ** 2, axis=0)
        if look is not None:
            change = change + np.diff(look, axis=axis) ** 2
        here, _ = _ends(axis)
        out[axis][here] = conductance[axis] * np.exp(-CONTRAST * change) + MINIMUM_WEIGHT
    return out


def _ends(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """All voxels with a next one along an axis, and these next ones."""
    here, there = [slice(None)] * 3, [slice(None)] * 3
    here[axis], there[axis] = slice(0, -1), slice(1, None)
    return tuple(here), tuple(there)


def _least_of_both(values: NDArray) -> Array:
    """The smaller value (3, nx, ny, nz) of each edge's two voxels."""
    out = np.zeros((3, *values.shape))
    for axis in range(3):
        here, there = _ends(axis)
        out[axis][here] = np.minimum(values[here], values[there])
    return out


def balanced(weights: Array, seeds: BoolArray, known: NDArray, prior: float, wanted: NDArray) -> Array:
    """The walker's probability (nx, ny, nz).

    Edges have `weights` (3, nx, ny, nz). Seeds keep what is known of them; every other voxel is pulled to
    what is wanted with the weight `prior`.
    """
    free, known = ~seeds, known.astype(float)
    edges, ground = np.zeros_like(weights), np.where(free, prior, 0.0)
    load = ground * wanted
    for axis in range(3):
        here, there = _ends(axis)
        weight = weights[axis][here]
        edges[axis][here] = weight * (free[here] & free[there])
        for own, other in ((here, there), (there, here)):
            pull = weight * (free[own] & seeds[other])
            ground[own] += pull
            load[own] += pull * known[other]
    start = np.pad(np.where(free, wanted, 0.0), 1)
    rim = ((0, 0), (1, 1), (1, 1), (1, 1))
    found = harmonic(np.pad(edges, rim), np.pad(ground, 1), np.pad(load, 1), start, STOP)
    return np.where(free, found, known)


def _around(mask: BoolArray, reach: Array) -> tuple[slice, ...]:
    """The box of a mask and some voxels around it."""
    found = ndimage.find_objects(mask.astype(np.uint8))[0]
    steps = np.ceil(reach).astype(int)
    return tuple(
        slice(max(s.start - int(n), 0), min(s.stop + int(n), size))
        for s, n, size in zip(found, steps, mask.shape, strict=True)
    )
