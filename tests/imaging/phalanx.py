"""Small synthetic images with analytic truth: blurred by the voxel, with noise."""

from __future__ import annotations

import numpy as np

from handpipe.imaging.volumes.volume import Volume

SPACING = 0.5


def points_of(lower, upper, spacing=SPACING):
    """Voxel centres (nx, ny, nz, 3) of a box, and the affine; spacing: one for all axes, or of each."""
    steps = np.broadcast_to(np.asarray(spacing, float), 3)
    axes = [np.arange(a, b, h) for a, b, h in zip(lower, upper, steps, strict=True)]
    affine = np.diag([*steps, 1.0])
    affine[:3, 3] = lower
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), affine


def grid_points(volume):
    """Centres (nx, ny, nz, 3) of a volume's voxels."""
    return volume.to_world(np.indices(volume.shape).reshape(3, -1).T).reshape(*volume.shape, 3)


def voxelised(intensity, lower, upper, noise=0.04, seed=0, spacing=SPACING, fine=3):
    """Volume of a function of points: the mean over each voxel, with Rician noise."""
    points, affine = points_of(lower, upper, spacing)
    shifts = (np.arange(fine) - (fine - 1) / 2) / fine
    shifts = np.stack(np.meshgrid(shifts, shifts, shifts), axis=-1).reshape(-1, 3) * spacing
    values = np.mean([intensity(points + s) for s in shifts], axis=0)
    random = np.random.default_rng(seed)
    real, imaginary = noise * random.standard_normal((2, *values.shape))
    return Volume(np.hypot(values + real, imaginary).astype(np.float32), affine)


def capsule(points, a, b):
    """Distance of points to the segment from a to b."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(points - (a + t[..., None] * (b - a)), axis=-1)


class Phalanx:
    """A capsule of marrow in a shell that is thick in the middle, with a tendon that touches it below.

    Bright fat above, grey muscle below (level 0.45), a dark tendon of radius 1.5 along x under the bone.
    """

    a, b, marrow_radius = np.array([-8.0, 0, 0]), np.array([8.0, 0, 0]), 4.0
    tendon_radius = 1.5

    def thickness(self, points):
        return 0.35 + 0.75 * np.exp(-((points[..., 0] / 5.0) ** 2))

    def marrow(self, points):
        """Negative in the marrow."""
        return capsule(points, self.a, self.b) - self.marrow_radius

    def bone(self, points):
        """Negative in the whole bone."""
        return self.marrow(points) - self.thickness(points)

    def tendon(self, points):
        """Negative in the tendon."""
        z = -(self.marrow_radius + 1.1 + self.tendon_radius - 0.1)
        return np.hypot(points[..., 1], points[..., 2] - z) - self.tendon_radius

    def intensity(self, points):
        value = np.where(points[..., 2] > -1, 0.9, 0.45)
        value = np.where(self.tendon(points) < 0, 0.03, value)
        value = np.where(self.bone(points) < 0, 0.03, value)
        return np.where(self.marrow(points) < 0, 1.0, value)

    def volume(self, noise=0.04, seed=0, spacing=SPACING):
        return voxelised(self.intensity, (-16, -9, -11), (16, 9, 9), noise, seed, spacing)

    def seeds(self, volume):
        """A stroke along the axis, and a few voxels around the bone."""
        points = grid_points(volume)
        seeds = np.zeros(volume.shape, np.uint8)
        seeds[capsule(points, self.a * 0.7, self.b * 0.7) < 0.6] = 1
        far = np.abs(self.bone(points) - 2.5) < 0.3
        far &= np.random.default_rng(0).random(far.shape) < 0.02
        seeds[far] = 255
        return seeds
