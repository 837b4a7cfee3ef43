"""Slim long bones with analytic truth: what a generated hand with wide marrow does not show.

A bone is a solid of revolution about an oblique axis: a base and a head of spongy bone under thin cortex,
and a shaft whose thick cortex leaves a canal of few voxels, or none for a while. Lengths are those of a
median male hand (Buryanov and Kotiuk 2010); widths are shares of the length, slimmer than the phantom hand's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from phalanx import capsule, grid_points, voxelised
from scipy.ndimage import distance_transform_edt

LENGTHS = {"metacarpal3": 64.6, "metacarpal5": 53.7, "proximal2": 39.8, "middle4": 25.7, "distal5": 15.9}
OBLIQUE = np.array([1.0, 0.17, 0.11]) / np.linalg.norm([1.0, 0.17, 0.11])


@dataclass(frozen=True)
class SlimBone:
    """length in mm; canal: the marrow's least diameter in mm; cortex: under the ends; parted: mm of the shaft
    without marrow; side: -1 mirrors it (a left hand); dim: level of the marrow in the distal third;
    texture: amplitude of trabeculae; muscle: the level of the tissue below, fat lies above.
    """

    length: float = 39.8
    canal: float = 1.5
    cortex: float = 0.5
    parted: float = 0.0
    side: int = 1
    dim: float = 1.0
    texture: float = 0.0
    muscle: float = 0.45

    def place(self, points):
        """Distance along the axis from the middle, as a share of half the length, and from the axis in mm."""
        axis = OBLIQUE * [1, self.side, 1]
        along = points @ axis
        across = np.linalg.norm(points - along[..., None] * axis, axis=-1)
        return 2 * along / self.length, across

    def radius(self, u):
        """Outer radius (mm) of the bone at shares u of half its length."""
        widest = 0.115 * self.length
        ends = np.where(u < 0, 1.0, 0.88) * np.clip((np.abs(u) - 0.35) / 0.45, 0, 1) ** 2
        round_off = np.sqrt(np.clip(1 - ((np.abs(u) - 0.75) / 0.25).clip(0) ** 2, 0, 1))
        return widest * (0.55 + 0.45 * ends) * round_off

    def inner_radius(self, u):
        """Radius of the marrow: under the ends the cortex is thin, in the shaft the canal remains."""
        shorter = 1 - 2 * self.cortex / self.length
        shell = np.maximum(self.radius(u / shorter) - self.cortex, 0)
        shaft = np.clip(1 - (np.abs(u) / 0.55) ** 4, 0, 1)
        radius = shell + shaft * (np.minimum(shell, self.canal / 2) - shell)
        return np.where(np.abs(u + 0.1) * self.length < self.parted, 0.0, radius)

    def bone(self, points):
        """Whether points (..., 3) lie in the whole bone."""
        u, across = self.place(points)
        return across < self.radius(u)

    def marrow(self, points):
        """Whether points (..., 3) lie in the marrow."""
        u, across = self.place(points)
        return across < self.inner_radius(u)

    def intensity(self, points):
        u, _ = self.place(points)
        value = np.where(points[..., 2] > -0.5, 0.9, self.muscle)
        value = np.where(self.bone(points), 0.03, value)
        waves = np.prod(np.sin(points * 2.1 + [0, 1, 2]), axis=-1)
        marrow = np.where(u > 0.4, self.dim, 1.0) * (1 + self.texture * waves)
        return np.where(self.marrow(points), marrow, value)

    def volume(self, noise=0.03, seed=0, spacing=0.5):
        half = np.array([0.5 * self.length + 5, 0.28 * self.length + 4, 0.24 * self.length + 4])
        return voxelised(self.intensity, -half, half, noise, seed, spacing)

    def seeds(self, volume, seed=0, strokes=1, outside=3, length=3.0):
        """Strokes along the axis anywhere in the marrow, and around the bone anywhere within 5 mm."""
        points = grid_points(volume)
        random = np.random.default_rng(seed)
        seeds = np.zeros(volume.shape, np.uint8)
        marrow, bone = self.marrow(points), self.bone(points)
        distance = distance_transform_edt(~bone, sampling=volume.spacing)
        around = (distance > 1.2) & (distance < 5.0)
        for allowed, value, count in ((marrow, 1, strokes), (around, 255, outside)):
            middles = random.choice(points[allowed], count)
            directions = random.standard_normal((count, 3)) if value == 255 else [OBLIQUE] * count
            for middle, direction in zip(middles, directions, strict=True):
                half = 0.5 * length * np.asarray(direction) / np.linalg.norm(direction)
                seeds[(capsule(points, middle - half, middle + half) < 0.4) & allowed] = value
        return seeds
