"""The outer face of the cortical shell by a 3D watershed from markers (Meyer 1992; Wang 2019, Sec. 3.1).

The gradient is flooded from four kinds of markers: the marrow out to the darkest place of the shell around
it, every bright plateau outside, dark tissue too far off to be this bone's shell, and dark tissue nearer to
another bone's marrow. The bone's basin ends at the shell's outer edge where the shell borders on something
bright. Where it borders on a dark basin the line between them is arbitrary: no edge is there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage.segmentation import watershed

from handpipe.core import Array, BoolArray, Int32Array, IntArray
from handpipe.imaging.bone_surfaces.marrow import Cortex
from handpipe.imaging.evidence.profiles import graph_laplacian, sample_profiles, smooth_field
from handpipe.imaging.volumes.band import DistanceBand, at_closest
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface

THICKEST = 2.2  # mm of cortical bone in a hand
REACH = THICKEST + 1.0  # mm either side of the marrow's surface that are flooded
FINER = 2  # grid points along a voxel's shortest edge: a shell is about one voxel thick
BRIGHT = 0.25  # of the marrow's contrast with the shell: brighter tissue is not dark
EDGE = 0.5  # voxels, deviation of the Gaussian under the gradient
VALLEY = 1.2  # mm outwards in which a shell's darkest place lies
LEAST_VALLEY = 0.2  # mm of shell that belongs to its marker
STEP = 0.1  # mm between samples of a profile out of the marrow
OFF = 0.2  # mm from the neighbours' darkest place, from which a place loses weight


class Basin(IntEnum):
    """Basins of the watershed around a bone: the bone, and its bright or dark surroundings."""

    bone = 1
    bright = 2
    dark = 3


class OuterFaces(NamedTuple):
    """Where rays along the marrow's normals leave the bone's basin.

    Offsets are (n,) in mm. `seen` (n,) tells whether a ray goes into something bright, so that the image
    shows the face.
    """

    offset: Array
    seen: BoolArray


def shell_basins(volume: Volume, cortex: Cortex, marrow: Surface, others: Sequence[Surface] = ()) -> Volume:
    """Basins around a bone's marrow surface on a grid finer than the volume's.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    cortex : Cortex
        How cortical bone shows in the image.
    marrow : Surface
        The bone's marrow surface in world mm.
    others : sequence of Surface, optional
        Marrow surfaces of the bones near it.

    Returns
    -------
    Volume
        Values of `Basin`; 0 in voxels that the flood does not need.
    """
    indices = volume.to_index(marrow.vertices)
    margin = (REACH + 1.0) / volume.spacing + 1
    lower, upper = np.floor(indices.min(0) - margin), np.ceil(indices.max(0) + margin) + 1
    local = volume.crop(lower.astype(np.int64), upper.astype(np.int64))
    grid = FineGrid.over(local)
    voxel = float(volume.spacing.max())
    band = DistanceBand.around(marrow, local, REACH + voxel, inwards=2 * voxel)
    depth = np.sign(band.signed) * REACH
    valley = _valley(volume, cortex, marrow)
    depth[tuple(band.indices.T)] = band.signed[tuple(band.indices.T)] - at_closest(
        marrow, band.triangles, band.closest, valley
    )
    distance = grid.linear(band.signed)
    values = grid.cubic(local.values)
    gradient = ndimage.gaussian_gradient_magnitude(values, EDGE * FINER)
    markers = _markers(grid, values, gradient, distance, grid.linear(depth), cortex, others)
    basins = watershed(gradient, markers, mask=(distance < REACH) & (distance > -voxel))
    basins[distance <= -voxel] = Basin.bone
    return Volume(basins.astype(np.float32), grid.affine)


def outer_faces(basins: Volume, marrow: Surface) -> OuterFaces:
    """The faces of the bone's basin along the normals at the marrow's vertices."""
    step = 0.25 * float(basins.spacing.mean())
    offsets = np.arange(0.0, REACH, step)
    points = marrow.vertices[:, None] + offsets[:, None] * marrow.vertex_normals()[:, None]
    indices = np.round(basins.to_index(points.reshape(-1, 3))).astype(np.int64)
    indices = np.clip(indices, 0, np.array(basins.shape) - 1)
    along = basins.values[tuple(indices.T)].reshape(len(marrow.vertices), -1)
    left = along != Basin.bone
    first = np.argmax(left, axis=1)
    beyond = np.take_along_axis(along, first[:, None], axis=1)[:, 0]
    return OuterFaces(offsets[first] - 0.5 * step, beyond == Basin.bright)


@dataclass(frozen=True)
class FineGrid:
    """A grid over a volume, of cubes `FINER` times as fine as its shortest voxel edge.

    Parameters
    ----------
    coordinates : tuple of 3 arrays
        The grid's points along each axis, in voxels of the volume.
    affine : array (4, 4)
        From indices of the grid to world mm.
    """

    coordinates: tuple[Array, Array, Array]
    affine: Array

    @staticmethod
    def over(volume: Volume) -> FineGrid:
        """The grid from the first voxel's centre to the last one's."""
        counts = np.round((np.array(volume.shape) - 1) * FINER * volume.spacing / volume.spacing.min()) + 1
        x, y, z = (np.linspace(0, n - 1, int(m)) for n, m in zip(volume.shape, counts, strict=True))
        steps = np.append((np.array(volume.shape) - 1) / (counts - 1), 1.0)
        return FineGrid((x, y, z), volume.affine @ np.diag(steps))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of grid points along each axis."""
        nx, ny, nz = (len(c) for c in self.coordinates)
        return nx, ny, nz

    def to_world(self, indices: NDArray) -> Array:
        """World points (n, 3) of voxel indices (n, 3) of this grid."""
        return np.asarray(indices, float) @ self.affine[:3, :3].T + self.affine[:3, 3]

    def cubic(self, values: NDArray) -> NDArray[np.float32]:
        """The volume's values, by cubic splines."""
        return self._blended(ndimage.spline_filter(values, 3, np.float32, mode="mirror"), cubic_spline, 2)

    def linear(self, values: NDArray) -> NDArray[np.float32]:
        """The volume's values, by trilinear interpolation."""
        return self._blended(values, lambda t: np.maximum(1 - np.abs(t), 0.0), 1)

    def _blended(self, values: NDArray, kernel: Callable[[Array], Array], reach: int) -> NDArray[np.float32]:
        """Sums of the values times a kernel of the distance in voxels, axis by axis; mirrored at the ends."""
        out = np.asarray(values, np.float32)
        for axis, at in enumerate(self.coordinates):
            last, base = values.shape[axis] - 1, np.floor(at).astype(np.int64)
            total = np.zeros(1, np.float32)
            for near in (base + k for k in range(1 - reach, reach + 1)):
                weight = kernel(at - near).astype(np.float32)
                mirrored = last - np.abs(last - np.abs(near))
                shape = [len(at) if c == axis else 1 for c in range(3)]
                total = total + np.take(out, mirrored, axis) * weight.reshape(shape)
            out = total
        return out


def cubic_spline(t: Array) -> Array:
    """The cubic B-spline at distances t from its middle."""
    t = np.abs(t)
    return np.where(t < 1, 2 / 3 - t**2 + t**3 / 2, np.maximum(2 - t, 0.0) ** 3 / 6)


def _markers(
    grid: FineGrid,
    values: NDArray[np.float32],
    gradient: NDArray[np.float32],
    distance: NDArray[np.float32],
    depth: NDArray[np.float32],
    cortex: Cortex,
    others: Sequence[Surface],
) -> Int32Array:
    """Markers (nx, ny, nz) of the basins; 0 where the flood decides.

    distance: from the marrow's surface; depth: from the darkest place outside it, less than 0 before it.
    """
    dark = values < cortex.level + BRIGHT * (cortex.marrow - cortex.level)
    plateau = gradient <= ndimage.minimum_filter(gradient, 3)
    markers = np.zeros(grid.shape, np.int32)
    markers[plateau & ~dark] = Basin.bright
    markers[dark & (distance > THICKEST)] = Basin.dark
    rivalled = dark & (distance > 0) & (distance < REACH)
    markers[tuple(_nearer_to(others, grid, rivalled, distance).T)] = Basin.dark
    markers[(distance < LEAST_VALLEY) | (depth < 0)] = Basin.bone
    return markers


def _valley(volume: Volume, cortex: Cortex, marrow: Surface) -> Array:
    """Offset (n,) of the darkest place on the way out of the marrow, before the first clear rise."""
    offsets = np.arange(0.0, VALLEY + 1e-9, STEP)
    profiles = sample_profiles(volume, marrow.vertices, marrow.vertex_normals(), offsets)
    risen = profiles > np.minimum.accumulate(profiles, axis=1) + 2 * cortex.noise
    before = np.where(np.maximum.accumulate(risen, axis=1), np.inf, profiles)
    found = offsets[np.argmin(before, axis=1)]
    laplacian = graph_laplacian(marrow.triangles, len(marrow.vertices))
    return smooth_field(laplacian, found, np.ones(len(found)), stiffness=1.0, scale=OFF)[0]


def _nearer_to(
    others: Sequence[Surface], grid: FineGrid, where: BoolArray, distance: NDArray[np.float32]
) -> IntArray:
    """Voxels (m, 3) of those asked for that are nearer to other surfaces' vertices than to the own one."""
    indices = np.argwhere(where)
    close = [s.vertices[_within(s.vertices, grid, REACH)] for s in others]
    vertices = np.concatenate([np.zeros((0, 3)), *close])
    if len(vertices) == 0:
        return indices[:0]
    own = distance[tuple(indices.T)]
    other = cKDTree(vertices).query(grid.to_world(indices), distance_upper_bound=REACH)[0]
    return indices[other < own]


def _within(points: Array, grid: FineGrid, reach: float) -> BoolArray:
    """Which points (n, 3) lie in the grid's box or within `reach` mm of it."""
    index = (points - grid.affine[:3, 3]) @ np.linalg.inv(grid.affine[:3, :3]).T
    margin = reach / np.linalg.norm(grid.affine[:3, :3], axis=0)
    return ((index > -margin) & (index < np.array(grid.shape) + margin)).all(axis=1)
