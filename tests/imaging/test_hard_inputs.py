"""Images as they come: voxels that are no cubes, a bias field, tiny bones, bones that are cut off."""

import logging

import numpy as np
import pytest
from phalanx import Phalanx, capsule, grid_points, voxelised

from handpipe.imaging.bone_surfaces.cortical import whole_bone
from handpipe.imaging.bone_surfaces.marrow import marrow_surface
from handpipe.imaging.segmentation.claims import appearances, doubted
from handpipe.imaging.segmentation.random_walker import INSIDE, OUTSIDE, Stop, random_walker
from handpipe.imaging.segmentation.segmentation import SegmentationSettings, segment_bone
from handpipe.imaging.volumes.rasterisation import rasterise

SETTINGS = SegmentationSettings()


def dice(a, b):
    return 2 * (a & b).sum() / (a.sum() + b.sum())


def surfaces(truth, volume):
    bone = segment_bone(volume, truth.seeds(volume), 1, SETTINGS)
    marrow = marrow_surface(volume, bone)
    return bone, marrow, whole_bone(volume, bone, marrow)


@pytest.mark.parametrize("spacing", [(0.5, 0.5, 1.0), (1.0, 0.5, 0.5)])
def test_slices_twice_as_thick_as_voxels_are_wide(spacing) -> None:
    """As the papers' scans: both surfaces within a fifth of the short edge, Dice on fine voxels."""
    truth = Phalanx()
    _, marrow, whole = surfaces(truth, truth.volume(spacing=np.array(spacing)))
    fine = truth.volume(noise=0.0)
    points = grid_points(fine)
    assert marrow.is_closed()
    assert whole.is_closed()
    assert np.abs(truth.marrow(marrow.vertices)).mean() < 0.1
    assert np.abs(truth.bone(whole.vertices)).mean() < 0.1
    assert dice(rasterise(fine, {1: marrow}) == 1, truth.marrow(points) < 0) > 0.98
    assert dice(rasterise(fine, {1: whole}) == 1, truth.bone(points) < 0) > 0.97


def test_the_walker_knows_the_voxels_size() -> None:
    """Between seeded walls of a duct of long voxels the solution is that of the Laplacian in mm.

    Walls at x = 0 (inside) and z = 0 (outside) of a square: with coordinates in mm the angle about their edge
    is harmonic.
    """
    spacing = np.array([0.5, 0.5, 1.0])
    x, _, z = np.moveaxis(np.indices((41, 3, 21)), 0, -1).transpose(3, 0, 1, 2) * spacing.reshape(3, 1, 1, 1)
    angle = np.arctan2(x, z) / (np.pi / 2)  # 0 where x = 0, 1 where z = 0
    seeds = np.zeros(x.shape, np.uint8)
    seeds[(x == 0)] = INSIDE
    seeds[(z == 0)] = OUTSIDE
    found = random_walker(np.ones(x.shape), seeds, 50.0, spacing=spacing, stop=Stop(1e-7))
    near = (np.hypot(x, z) > 2.0) & (np.hypot(x, z) < 6.0)  # away from the corner and from free ends
    wrong = random_walker(np.ones(x.shape), seeds, 50.0, stop=Stop(1e-7))
    error, error_of_cubes = (np.abs(p - (1 - angle))[near].mean() for p in (found, wrong))
    assert error < 0.3 * error_of_cubes


def test_a_strong_bias_field_along_the_bone() -> None:
    """Intensities that double from one end of the bone to the other."""
    truth = Phalanx()

    def biased(points):
        return truth.intensity(points) * 2.0 ** ((points[..., 0] + 12.0) / 24.0)

    volume = voxelised(biased, (-16, -9, -11), (16, 9, 9))
    bone, marrow, whole = surfaces(truth, volume)
    points = grid_points(volume)
    assert dice(rasterise(volume, {1: marrow}) == 1, truth.marrow(points) < 0) > 0.98
    assert dice(rasterise(volume, {1: whole}) == 1, truth.bone(points) < 0) > 0.97
    assert appearances(volume, {"phalanx": bone})["phalanx"].enclosed > 0.95


class Tip(Phalanx):
    """The marrow of a small distal phalanx: 7 mm long and 2.4 mm wide, at 1 mm some thirty voxels."""

    a, b, marrow_radius = np.array([-2.3, 0, 0]), np.array([2.3, 0, 0]), 1.2
    tendon_radius = 0.6

    def thickness(self, points):
        return np.full(points.shape[:-1], 0.5)

    def seeds(self, volume):
        points = grid_points(volume)
        seeds = np.zeros(volume.shape, np.uint8)
        seeds[capsule(points, self.a * 0.8, self.b * 0.8) < 0.5 * volume.spacing.max()] = 1
        seeds[np.abs(self.bone(points) - 3.0) < 0.3] = 255
        return seeds


@pytest.mark.parametrize(("spacing", "overlap"), [(0.5, 0.95), (1.0, 0.65)])
def test_a_bone_of_few_voxels(spacing, overlap) -> None:
    truth = Tip()
    volume = truth.volume(spacing=spacing)
    _, marrow, whole = surfaces(truth, volume)
    fine = truth.volume(noise=0.0, spacing=0.25)
    assert marrow.is_closed()
    assert whole.is_closed()
    assert dice(rasterise(fine, {1: marrow}) == 1, truth.marrow(grid_points(fine)) < 0) > overlap
    assert dice(rasterise(fine, {1: whole}) == 1, truth.bone(grid_points(fine)) < 0) > overlap


@pytest.mark.parametrize("axis", [0, 1])
def test_a_bone_that_the_volume_cuts_off(axis, caplog) -> None:
    """Cut across or along: closed surfaces, right where the bone is seen, and a warning that names it."""
    truth = Phalanx()
    whole_volume = truth.volume()
    upper = np.array(whole_volume.shape)
    upper[axis] = int(0.55 * upper[axis])
    volume = whole_volume.crop(np.zeros(3, int), upper)
    bone, marrow, whole = surfaces(truth, volume)
    face = volume.to_world(upper[None] - 1.0)[0, axis]
    points = grid_points(volume)
    assert marrow.is_closed()
    assert whole.is_closed()
    seen = marrow.vertices[:, axis] < face - 1.5
    assert np.abs(truth.marrow(marrow.vertices[seen])).mean() < 0.06
    assert marrow.vertices[:, axis].max() < face + 1.0
    assert dice(rasterise(volume, {1: marrow}) == 1, truth.marrow(points) < 0) > 0.97
    assert dice(rasterise(volume, {1: whole}) == 1, truth.bone(points) < 0) > 0.95
    with caplog.at_level(logging.WARNING):
        assert doubted(appearances(volume, {"phalanx": bone}), {}) == {}
    assert "phalanx: cut off by the volume's border" in caplog.text
