"""Images of bodies that are known as functions: partial volume, coil fall-off and Rician noise."""

from collections.abc import Callable, Sequence

import numpy as np

from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.generation import Grid, isosurface
from handpipe.mesh.surfaces import Surface

Body = Callable[[np.ndarray], np.ndarray]  # signed distance (…,) in mm of points (…, 3), negative inside

SAMPLES = 4  # a voxel and axis, of the partial volume
AIR, SKIN, GAIN = 0.02, 0.6, 800.0


def ball(radius: float) -> Body:
    return lambda x: np.linalg.norm(x, axis=-1) - radius


def capsule(start: Sequence[float], end: Sequence[float], radius: float) -> Body:
    a, b = np.array(start, float), np.array(end, float)

    def distance(x: np.ndarray) -> np.ndarray:
        along = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        return np.linalg.norm(x - a - along[..., None] * (b - a), axis=-1) - radius

    return distance


def image(
    body: Body,
    box: Sequence[Sequence[float]],
    spacing: float | Sequence[float],
    inner: Sequence[tuple[Body, float]] = (),
    noise: float = 0.03,
    fall_off: float = 0.6,
    seed: int = 0,
) -> Volume:
    """Image of a body in a box of two corners, with bodies of other intensities in it.

    Intensity falls by exp(-fall_off) along y. The grid does not start at the box's corner but anywhere near.
    """
    rng = np.random.default_rng(seed)
    voxel = np.broadcast_to(np.asarray(spacing, float), 3)
    low = np.array(box[0]) + voxel * rng.uniform(0, 1, 3)
    shape = np.ceil((np.array(box[1]) - low) / voxel).astype(int)
    middles = low + voxel * np.moveaxis(np.indices(shape), 0, -1)
    clean = np.full(shape, AIR)
    for part, value in ((body, SKIN), *inner):
        clean += (value - clean) * inside(part, middles, voxel)
    clean *= np.exp(-fall_off * np.linspace(0, 1, shape[1]))[:, None]
    real, imaginary = noise * rng.standard_normal((2, *shape))
    affine = np.diag([*voxel, 1.0])
    affine[:3, 3] = low
    return Volume((GAIN * np.hypot(clean + real, imaginary)).astype(np.float32), affine)


def inside(body: Body, middles: np.ndarray, voxel: np.ndarray) -> np.ndarray:
    """The share (…,) in a body of voxels, given by their middles (…, 3); sampled at its border."""
    within = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    samples = voxel * np.stack(np.meshgrid(within, within, within), axis=-1).reshape(-1, 3)
    distance = body(middles)
    border = np.abs(distance) <= np.linalg.norm(samples, axis=1).max()
    share = (distance < 0).astype(float)
    share[border] = (body(middles[border][:, None] + samples) < 0).mean(axis=1)
    return share


def surface(body: Body, around: np.ndarray, spacing: float = 0.7) -> Surface:
    """The surface of a body around some points (n, 3)."""
    grid = Grid.around(around, 2 * spacing, spacing)
    return isosurface(body(grid.points()), grid)
