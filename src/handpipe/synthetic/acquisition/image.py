"""Image model: closed tissue surfaces become an MRI-like volume.

Each voxel mixes its tissues by their shares (partial volume); a smooth bias field, Rician noise and a
scanner's gain follow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import nibabel
import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import Array, IntArray, atomic

Surface = tuple[Array, IntArray]

INTENSITIES = {
    "air": 0.02,
    "fat": 0.9,
    "marrow": 1.0,
    "muscle": 0.45,
    "cortical": 0.08,
    "tendon": 0.08,
    "ligament": 0.15,
}


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels along x, y, z: the centre of voxel (i, j, k) is origin + spacing (i, j, k), in mm."""

    shape: tuple[int, int, int]
    origin: Array
    spacing: float

    @staticmethod
    def around(points: Array, margin: float, spacing: float) -> VoxelGrid:
        """The grid that contains points (n, 3) and a margin in mm."""
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        nx, ny, nz = (int(n) for n in np.ceil((high - low) / spacing) + 1)
        return VoxelGrid((nx, ny, nz), low, spacing)

    @property
    def affine(self) -> Array:
        """Voxel indices to mm (4, 4)."""
        return np.block([[self.spacing * np.eye(3), self.origin[:, None]], [np.zeros(3), np.ones(1)]])

    def indices(self, points: Array) -> Array:
        """Continuous voxel indices (n, 3) of points in mm."""
        return (points - self.origin) / self.spacing


@njit(cache=True)
def _closest(px: float, py: float, pz: float, a: Array, b: Array, c: Array) -> float:
    """Squared distance of a point to a triangle."""
    ab0, ab1, ab2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac0, ac1, ac2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    ap0, ap1, ap2 = px - a[0], py - a[1], pz - a[2]
    d1 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2
    d2 = ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    aa = ab0 * ab0 + ab1 * ab1 + ab2 * ab2
    bb = ab0 * ac0 + ab1 * ac1 + ab2 * ac2
    cc = ac0 * ac0 + ac1 * ac1 + ac2 * ac2
    det = aa * cc - bb * bb
    best = 1e30
    if det > 1e-14:
        v, w = (cc * d1 - bb * d2) / det, (aa * d2 - bb * d1) / det
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            r0, r1, r2 = ap0 - v * ab0 - w * ac0, ap1 - v * ab1 - w * ac1, ap2 - v * ab2 - w * ac2
            return r0 * r0 + r1 * r1 + r2 * r2
    for edge in range(3):
        p, q = (a, b) if edge == 0 else ((b, c) if edge == 1 else (c, a))
        e0, e1, e2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        f0, f1, f2 = px - p[0], py - p[1], pz - p[2]
        length = e0 * e0 + e1 * e1 + e2 * e2
        t = 0.0
        if length > 0.0:
            t = min(1.0, max(0.0, (e0 * f0 + e1 * f1 + e2 * f2) / length))
        r0, r1, r2 = f0 - t * e0, f1 - t * e1, f2 - t * e2
        best = min(best, r0 * r0 + r1 * r1 + r2 * r2)
    return best


@njit(cache=True)
def _band(
    vertices: Array, triangles: IntArray, shape: tuple[int, int, int], width: float
) -> tuple[Array, NDArray]:
    """Distance of each voxel to a surface in voxel units, at most `width`, and whether it lies inside.

    Inside is the parity of crossings along +z, counted once a grid line and triangle.
    """
    nx, ny, nz = shape
    squared = np.full((nx, ny, nz), width * width)
    crossings = np.zeros((nx, ny, nz + 1), dtype=np.int32)
    for t in range(len(triangles)):
        a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        low = np.empty(3, dtype=np.int64)
        high = np.empty(3, dtype=np.int64)
        for d in range(3):
            low[d] = max(0, int(np.floor(min(a[d], b[d], c[d]) - width)))
            high[d] = min(shape[d] - 1, int(np.ceil(max(a[d], b[d], c[d]) + width)))
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    d2 = _closest(float(i), float(j), float(k), a, b, c)
                    if d2 < squared[i, j, k]:
                        squared[i, j, k] = d2
                if area != 0.0:
                    # A tiny shift keeps grid lines off edges and vertices, where parity is undefined.
                    x, y = i + 1.234e-7, j + 3.137e-7
                    u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                    v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                    w = 1.0 - u - v
                    if u >= 0.0 and v >= 0.0 and w > 0.0:
                        z = u * a[2] + v * b[2] + w * c[2]
                        crossings[i, j, min(nz, max(0, int(np.ceil(z))))] ^= 1
    inside = np.zeros((nx, ny, nz), dtype=np.bool_)
    for i in range(nx):
        for j in range(ny):
            state = 0
            for k in range(nz):
                state ^= crossings[i, j, k]
                inside[i, j, k] = state == 1
    return np.sqrt(squared), inside


Block = tuple[slice, slice, slice]
Share = tuple[Block, Array]
"""Shares in [0, 1] of the voxels of a block of the grid; none of any other voxel."""


def local_distance(surface: Surface, grid: VoxelGrid, width: float) -> Share | None:
    """Signed distances in mm, at most `width`, in the block of voxels about a surface, if any is there."""
    vertices, triangles = surface
    local = grid.indices(vertices)
    reach = width / grid.spacing
    low = np.maximum(np.floor(local.min(axis=0) - reach).astype(int), 0)
    high = np.minimum(np.ceil(local.max(axis=0) + reach).astype(int) + 1, grid.shape)
    sx, sy, sz = (int(n) for n in high - low)
    if min(sx, sy, sz) <= 0:
        return None
    distance, inside = _band(np.ascontiguousarray(local - low), triangles, (sx, sy, sz), reach)
    bx, by, bz = (slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
    return (bx, by, bz), np.where(inside, -distance, distance) * grid.spacing


def signed_distance(surface: Surface, grid: VoxelGrid, width: float) -> Array:
    """Signed distance in mm (negative inside) of each voxel centre to a closed surface, at most `width`."""
    result = np.full(grid.shape, width)
    if found := local_distance(surface, grid, width):
        result[found[0]] = found[1]
    return result


def local_occupancy(surface: Surface, grid: VoxelGrid) -> list[Share]:
    """As `occupancy`, in the block of voxels that the surface can fill; empty where it is off the grid."""
    found = local_distance(surface, grid, grid.spacing)
    return [(found[0], np.clip(0.5 - found[1] / grid.spacing, 0.0, 1.0))] if found else []


def occupancy(surface: Surface, grid: VoxelGrid) -> Array:
    """Share of each voxel inside a closed surface, for a boundary taken as plane: clip(1/2 - d/h, 0, 1).

    A curved boundary counts about h^2 / 12 times its total curvature too much: 0.6 % of a ball of 12 voxels.
    """
    result = np.zeros(grid.shape)
    for block, share in local_occupancy(surface, grid):
        result[block] = share
    return result


def paint_shares(image: Array, intensity: float, shares: Iterable[Share]) -> None:
    """Paint one tissue over an image, in place; its shares add up to at most one."""
    _paint_layer(image, intensity, total_share(shares, image.shape))


def total_share(shares: Iterable[Share], shape: tuple[int, ...]) -> Array:
    """The sum of one tissue's shares, at most one."""
    total = np.zeros(shape)
    for block, share in shares:
        total[block] += share
    return np.minimum(total, 1.0, out=total)


def paint_layers(
    layers: Iterable[tuple[str, NDArray]], levels: Mapping[str, float], grid: VoxelGrid
) -> Array:
    """Noise-free image of tissues in paint order over air: each has a level and a share of each voxel.

    The arrays of shares are used up.
    """
    image = np.full(grid.shape, levels["air"])
    for tissue, share in layers:
        _paint_layer(image, levels[tissue], share)
    return image


def _paint_layer(image: Array, intensity: float, share: NDArray) -> None:
    share *= intensity - image
    image += share


def label_volume(surfaces: Mapping[int, Surface], grid: VoxelGrid) -> NDArray[np.uint8]:
    """Label volume of closed surfaces by label: each voxel gets the label that fills more than half of it."""
    labels = np.zeros(grid.shape, dtype=np.uint8)
    for value, surface in surfaces.items():
        for block, share in local_occupancy(surface, grid):
            labels[block][share > 0.5] = value
    return labels


def bias_field(grid: VoxelGrid, amplitude: float, rng: np.random.Generator) -> Array:
    """Smooth positive field within 1 +- amplitude: a random polynomial of second order."""
    x, y, z = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in grid.shape), indexing="ij", sparse=True)
    c = rng.uniform(-1.0, 1.0, 9)
    field = c[0] * x + c[1] * y + c[2] * z + c[3] * x * y + c[4] * y * z + c[5] * z * x
    field = field + c[6] * (x**2 - 0.5) + c[7] * (y**2 - 0.5) + c[8] * (z**2 - 0.5)
    return 1.0 + amplitude * field / np.abs(field).max()


def acquire(
    clean: Array, grid: VoxelGrid, rng: np.random.Generator, *, bias: float = 0.2, noise: float = 0.03
) -> tuple[Array, Array, float]:
    """Scan a noise-free image: bias field, Rician noise (sigma before the gain) and an arbitrary gain.

    Returns the image, the bias field and the gain.
    """
    field = bias_field(grid, bias, rng)
    gain = float(rng.uniform(300.0, 1500.0))
    real = clean * field
    real += noise * rng.standard_normal(grid.shape)
    imaginary = rng.standard_normal(grid.shape)
    imaginary *= noise
    np.hypot(real, imaginary, out=real)
    real *= gain
    return real, field, gain


def write_volume(path: str | object, data: NDArray, grid: VoxelGrid) -> None:
    """Write a volume on the grid as NIfTI (RAS+ affine in mm), atomically."""
    image = nibabel.Nifti1Image(data, grid.affine)
    image.header.set_xyzt_units("mm")
    with atomic(str(path)) as temporary:
        nibabel.save(image, temporary)
