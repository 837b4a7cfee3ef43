"""Errors against the phantom's truth: overlap of surfaces, rotations and centroids of bones."""

from __future__ import annotations

import numpy as np

from benchmarks.bones.subject import Scan
from handpipe.core import Array, RigidTransform
from handpipe.evaluation import dice
from handpipe.imaging.volumes import Volume, rasterise
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.acquisition import image

SPACING = 0.5  # mm of the grid of overlaps, whatever the image's voxels


def overlap(found: Surface, truth: image.Surface, scan: Scan) -> float:
    """Dice of a found and a true closed surface, on voxels of 0.5 mm inside the scan's volume."""
    low, high = scan.field_of_view
    points = np.clip(np.concatenate([found.vertices, truth[0]]), low + SPACING, high - SPACING)
    grid = image.VoxelGrid.around(points, 0.0, SPACING)
    volume = Volume(np.zeros(grid.shape, np.float32), grid.affine)
    return dice(rasterise(volume, {1: found}), image.label_volume({1: truth}, grid), 1)


def motion_error(found: RigidTransform, truth: RigidTransform, centroid: Array) -> tuple[float, float]:
    """Angle in deg, and distance of the centroid's images in mm."""
    apart = np.linalg.norm(found(centroid) - truth(centroid))
    return float(np.degrees(found.angle_to(truth))), float(apart)
