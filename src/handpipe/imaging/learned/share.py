"""What each bone gets of the voxels: one part without holes, and no voxel for two bones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import BoolArray
from handpipe.imaging.volumes import Labels

SMOOTHING = 0.7  # voxels: what a border of single voxels says is noise


@dataclass
class BoneShare:
    """One bone's share in a box of the image.

    Parameters
    ----------
    label : int
        Label of the bone.
    region : tuple of 3 slices
        The box.
    values : array (nx, ny, nz)
        Share of each voxel of the box, 0 to 1; above 0.5 the voxel is the bone's.
    """

    label: int
    region: tuple[slice, ...]
    values: NDArray

    @property
    def claimed(self) -> BoolArray:
        """The bone's voxels in the box."""
        return np.asarray(self.values > 0.5)


def tidied(shares: Mapping[str, BoneShare], seeds: Labels) -> dict[str, BoneShare]:
    """Shares (labels' strokes in `seeds`) smoothed, each bone in one part without holes."""
    smooth = {
        name: BoneShare(s.label, s.region, ndimage.gaussian_filter(s.values, SMOOTHING))
        for name, s in shares.items()
    }
    taken = np.zeros(seeds.shape, bool)
    for share in smooth.values():
        taken[share.region] |= share.claimed
    return {name: _one_part(s, seeds[s.region] == s.label, taken[s.region]) for name, s in smooth.items()}


def _one_part(share: BoneShare, strokes: BoolArray, taken: BoolArray) -> BoneShare:
    """The part that holds most of the strokes, without threads of a voxel, its holes filled."""
    claimed = share.claimed
    parts, _ = ndimage.label(ndimage.binary_opening(claimed) | (claimed & strokes))
    counts = np.bincount(parts[strokes], minlength=2)
    counts[0] = 0
    kept = parts == max(int(counts.argmax()), 1)
    whole = ndimage.binary_fill_holes(kept) & (claimed | ~taken)
    wrong = whole != claimed  # of the other side than the smoothed share says
    return BoneShare(share.label, share.region, np.where(wrong, 1 - share.values, share.values))


def labelled(shares: Mapping[str, BoneShare], shape: tuple[int, ...]) -> Labels:
    """Label (nx, ny, nz) of each voxel, 0 for no bone."""
    out = np.zeros(shape, np.uint8)
    for share in shares.values():
        out[share.region][share.claimed] = share.label
    return out
