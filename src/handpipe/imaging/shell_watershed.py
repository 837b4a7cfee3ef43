"""The outer face of the cortical shell by a 3D watershed from markers (Meyer 1992; Wang 2019, Sec. 3.1).

The gradient is flooded from four kinds of markers: the marrow out to the darkest place of the shell around
it, every bright plateau outside, dark tissue too far off to be this bone's shell, and dark tissue nearer to
another bone's marrow. The bone's basin ends at the shell's outer edge where the shell borders on something
bright. Where it borders on a dark basin the line between them is arbitrary: no edge is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage.segmentation import watershed

from handpipe.imaging.band import DistanceBand, at_closest
from handpipe.imaging.marrow import Cortex
from handpipe.imaging.profiles import graph_laplacian, sample_profiles, smooth_field
from handpipe.imaging.volume import Volume
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]

THICKEST = 2.2  # mm of cortical bone in a hand
FINER = 2  # grid points a voxel along each axis: a shell is about one voxel thick
BRIGHT = 0.25  # of the marrow's contrast with the shell: brighter tissue is not dark
EDGE = 0.5  # voxels, deviation of the Gaussian under the gradient
VALLEY = 1.2  # mm outwards in which a shell's darkest place lies
LEAST_VALLEY = 0.2  # mm of shell that belongs to its marker


class Basin(IntEnum):
    bone = 1
    bright = 2
    dark = 3


class OuterFaces(NamedTuple):
    """Where rays along the marrow's normals leave the bone's basin: offsets (n,) in mm; whether into
    something bright (n,), so that the image shows the face."""

    offset: Array
    seen: NDArray[np.bool_]


def shell_basins(volume: Volume, cortex: Cortex, marrow: Surface, others: Sequence[Surface] = ()) -> Volume:
    """Basins (values of `Basin`) around a bone's marrow surface on a grid finer than the volume's.

    others: the marrow surfaces of the bones near it.
    """
    fine = _finer(volume, marrow, THICKEST + 3 * float(volume.spacing.max()))
    gradient = ndimage.gaussian_gradient_magnitude(fine.values, EDGE * FINER)
    markers = _markers(volume, fine, gradient, cortex, marrow, others)
    return fine.like(watershed(gradient, markers))


def outer_faces(basins: Volume, marrow: Surface) -> OuterFaces:
    """The faces of the bone's basin along the normals at the marrow's vertices."""
    step = 0.25 * float(basins.spacing.mean())
    offsets = np.arange(0.0, THICKEST + 1.0, step)
    points = marrow.vertices[:, None] + offsets[:, None] * marrow.vertex_normals()[:, None]
    indices = np.round(basins.to_index(points.reshape(-1, 3))).astype(np.int64)
    indices = np.clip(indices, 0, np.array(basins.shape) - 1)
    along = basins.values[tuple(indices.T)].reshape(len(marrow.vertices), -1)
    left = along != Basin.bone
    first = np.argmax(left, axis=1)
    beyond = np.take_along_axis(along, first[:, None], axis=1)[:, 0]
    return OuterFaces(offsets[first] - 0.5 * step, beyond == Basin.bright)


def _finer(volume: Volume, surface: Surface, margin: float) -> Volume:
    """The volume around a surface, interpolated by cubic splines on a grid `FINER` times as fine."""
    indices = volume.to_index(surface.vertices)
    lower = np.floor(indices.min(0) - margin / volume.spacing).astype(np.int64)
    upper = np.ceil(indices.max(0) + margin / volume.spacing).astype(np.int64) + 1
    local = volume.crop(lower, upper)
    shape = FINER * (np.array(local.shape) - 1) + 1
    values = ndimage.zoom(local.values, shape / local.shape, order=3, mode="nearest")
    return Volume(values, local.affine @ np.diag([1 / FINER] * 3 + [1.0]))


def _markers(
    volume: Volume,
    fine: Volume,
    gradient: NDArray[np.float32],
    cortex: Cortex,
    marrow: Surface,
    others: Sequence[Surface],
) -> NDArray[np.int32]:
    """Markers (nx, ny, nz) of the basins; 0 where the flood decides."""
    band = DistanceBand.around(marrow, fine, THICKEST + float(volume.spacing.max()))
    distance = band.signed
    dark = fine.values < cortex.level + BRIGHT * (cortex.marrow - cortex.level)
    plateau = gradient <= ndimage.minimum_filter(gradient, 3)
    markers = np.zeros(fine.shape, np.int32)
    markers[plateau & ~dark] = Basin.bright
    markers[dark & (distance > THICKEST)] = Basin.dark
    markers[tuple(_nearer_to(others, fine, dark & (distance > 0), distance).T)] = Basin.dark
    valley = at_closest(marrow, band.triangles, band.closest, _valley(volume, cortex, marrow))
    own = distance < LEAST_VALLEY
    own[tuple(band.indices.T)] |= distance[tuple(band.indices.T)] < valley
    markers[own] = Basin.bone
    return markers


def _valley(volume: Volume, cortex: Cortex, marrow: Surface) -> Array:
    """Offset (n,) of the darkest place on the way out of the marrow, before the first clear rise."""
    offsets = np.arange(0.0, VALLEY + 1e-9, 0.1)
    profiles = sample_profiles(volume, marrow.vertices, marrow.vertex_normals(), offsets)
    risen = profiles > np.minimum.accumulate(profiles, axis=1) + 2 * cortex.noise
    before = np.where(np.maximum.accumulate(risen, axis=1), np.inf, profiles)
    found = offsets[np.argmin(before, axis=1)]
    laplacian = graph_laplacian(marrow.triangles, len(marrow.vertices))
    return smooth_field(laplacian, found, np.ones(len(found)), stiffness=1.0, scale=0.2)[0]


def _nearer_to(
    others: Sequence[Surface], fine: Volume, where: NDArray[np.bool_], distance: Array
) -> NDArray[np.int64]:
    """Voxels (m, 3) of those asked for that are nearer to other surfaces' vertices than to the own one."""
    indices = np.argwhere(where)
    if not others:
        return indices[:0]
    own = distance[tuple(indices.T)]
    tree = cKDTree(np.concatenate([s.vertices for s in others]))
    other = tree.query(fine.to_world(indices), distance_upper_bound=float(own.max()) + 1e-9)[0]
    return indices[other < own]
