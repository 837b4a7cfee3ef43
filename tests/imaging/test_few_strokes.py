"""A short stroke in the marrow and three around the bone: right, or doubted."""

import numpy as np
import pytest
from phalanx import grid_points
from scipy import ndimage
from slim_bone import SlimBone

from handpipe.imaging.bone_surfaces.bridges import bridged
from handpipe.imaging.segmentation.claims import OPEN_FACES, appearances
from handpipe.imaging.segmentation.minimax_flood import flood
from handpipe.imaging.segmentation.open_boundary import open_patch
from handpipe.imaging.segmentation.segmentation import BoneProbability, SegmentationSettings, segment_bone
from handpipe.imaging.volumes.volume import Volume

SETTINGS = SegmentationSettings()


def dice(a, b):
    return 2 * (a & b).sum() / (a.sum() + b.sum())


def test_a_flood_costs_the_greatest_departure_on_the_best_path() -> None:
    """Two ways from left to right: one has a dip of 0.4, the other, longer one of 0.2."""
    values = np.zeros((5, 3, 1), np.float32)
    values[:, 0, 0] = [1.0, 1.0, 0.6, 1.0, 1.0]
    values[:, 2, 0] = [1.0, 0.9, 0.8, 0.9, 1.0]
    values[[0, 4], 1, 0] = 1.0
    source = np.zeros(values.shape, bool)
    source[0, 0] = True
    cost = flood(values, source, values > 0.3)
    assert cost[4, 0, 0] == pytest.approx(0.2, abs=0.006)
    assert cost[2, 0, 0] == pytest.approx(0.4, abs=0.006)
    assert np.isinf(cost[2, 1, 0])


@pytest.mark.parametrize("side", [1, -1])
def test_one_stroke_finds_both_ends_beyond_a_canal_of_three_voxels(side) -> None:
    truth = SlimBone(length=25.7, canal=1.5, side=side)
    volume = truth.volume()
    bone = segment_bone(volume, truth.seeds(volume, seed=1), 1, SETTINGS)
    found = np.zeros(volume.shape, bool)
    found[bone.slices] = bone.probability > 0.5
    assert dice(found, truth.marrow(grid_points(volume))) > 0.93


def test_a_claim_that_ends_across_the_marrow_is_open_there() -> None:
    truth = SlimBone(length=25.7, canal=3.0)
    volume = truth.volume()
    points = grid_points(volume)
    marrow = truth.marrow(points)
    assert open_patch(volume.values, marrow, volume.spacing).area < 3.0
    patch = open_patch(volume.values, marrow & (points[..., 0] < 0), volume.spacing)
    assert patch.area > 3.0
    assert abs(volume.to_world(patch.middle[None])[0, 0]) < 1.0


def test_a_flat_face_aslant_to_the_grid_is_closed_by_a_shell_of_one_voxel() -> None:
    """Marrow over a shell and muscle; layers of voxels that the face crosses are half of each."""
    spacing, finer = 0.45, 9
    x, y, z = np.indices((40, 40, 24 * finer)) * spacing
    depth = z / finer - 5.4 - 0.06 * (x - 9.0) - 0.02 * (y - 9.0)  # mm above the marrow's face
    fine = np.where(depth > 0.0, 1.0, np.where(depth > -0.46, 0.05, 0.55))
    values = fine.reshape(40, 40, 24, finer).mean(axis=3)
    values += 0.03 * np.random.default_rng(0).standard_normal(values.shape)
    marrow = (values > 0.6) & (depth > 0.0).reshape(40, 40, 24, finer).any(axis=3)
    patch = open_patch(values, marrow, np.full(3, spacing))
    assert patch.area < OPEN_FACES * spacing**2
    cut = open_patch(values, marrow & (np.indices(marrow.shape)[0] < 20), np.full(3, spacing))
    assert cut.area > 100 * spacing**2


def test_parts_of_one_marrow_are_joined() -> None:
    values = np.full((24, 9, 9), 0.1, np.float32)
    values[2:9, 3:6, 3:6] = values[15:22, 3:6, 3:6] = 1.0
    joined = bridged((values > 0.5).astype(np.float32), values)
    assert ndimage.label(joined > 0.5)[1] == 1
    assert (joined > 0.5).sum() < 2 * 7 * 9 + 6 * 9


@pytest.mark.parametrize("shape", [{"canal": 0.5}, {"canal": 1.0}, {"parted": 3.0}], ids=str)
def test_a_bone_of_which_half_is_lost_beyond_solid_bone_is_doubted(shape) -> None:
    truth = SlimBone(**shape)
    volume = truth.volume()
    bone = segment_bone(volume, truth.seeds(volume, seed=0), 1, SETTINGS)
    found = np.zeros(volume.shape, bool)
    found[bone.slices] = bone.probability > 0.5
    marrow = truth.marrow(grid_points(volume))
    look = appearances(volume, {"bone": bone})["bone"]
    assert dice(found, marrow) < 0.93
    assert look.unclaimed == pytest.approx((marrow & ~found).sum() * 0.125, rel=0.4)
    assert any("draw a stroke of its label there" in doubt for doubt in look.doubts())


def drawn_with_marrow(truth, seed):
    """What a stroke in a bone's marrow finds, the true marrow, and how the bone looks."""
    volume = truth.volume()
    bone = segment_bone(volume, truth.seeds(volume, seed=seed), 1, SETTINGS)
    found = np.zeros(volume.shape, bool)
    found[bone.slices] = bone.probability > 0.5
    marrow = truth.marrow(grid_points(volume))
    return volume, found, marrow, appearances(volume, {"bone": bone})["bone"]


@pytest.mark.parametrize("dim", [0.45, 0.5, 0.6])
def test_a_bone_whose_dim_end_is_lost_is_doubted_there(dim) -> None:
    """The dim third is as dark as muscle, and its shell is thinner than a voxel."""
    volume, found, marrow, look = drawn_with_marrow(SlimBone(dim=dim, length=25.7, canal=3.0), seed=1)
    assert dice(found, marrow) < 0.93
    nearest = np.abs(volume.to_world(np.argwhere(marrow & ~found)) - look.unclaimed_at).max(axis=1).min()
    assert nearest < 1.0
    assert any("look like marrow in the same shell" in doubt for doubt in look.doubts())


@pytest.mark.parametrize("dim", [0.45, 0.5, 0.6])
def test_a_long_bone_that_lost_its_dim_end_is_doubted(dim) -> None:
    """Its claim ends inside of the marrow, where no shell closes it, whether or not the dim part is found."""
    _, found, marrow, look = drawn_with_marrow(SlimBone(dim=dim, length=39.8, canal=3.0), seed=1)
    assert dice(found, marrow) < 0.93
    assert any("draw a stroke of its label there" in doubt for doubt in look.doubts())


@pytest.mark.parametrize("shape", [{"length": 25.7, "canal": 3.0}, {"length": 39.8, "canal": 3.0}], ids=str)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_bone_with_even_marrow_is_not_doubted(shape, seed) -> None:
    _, found, marrow, look = drawn_with_marrow(SlimBone(**shape), seed)
    assert dice(found, marrow) > 0.93
    assert look.doubts() == []


def test_a_whole_bone_leaves_no_marrow_over_though_its_neighbour_beyond_a_joint_does() -> None:
    """Two bones end to end with 1.5 mm of grey cartilage between them; nobody claims the second one."""
    bone = SlimBone(length=25.7, canal=3.0)
    volume = bone.volume()
    marrow = bone.marrow(grid_points(volume))
    inside = np.flatnonzero(bone.bone(grid_points(volume)).any(axis=(1, 2)))
    first, last = inside[0], inside[-1] + 1
    gap = np.full((3, *volume.shape[1:]), 0.6, np.float32)
    ends = volume.values[:last], gap, volume.values[first:]
    both = Volume(np.concatenate(ends).astype(np.float32), volume.affine)
    claimed = np.zeros(both.shape, np.float32)
    claimed[:last] = marrow[:last]
    look = appearances(both, {"bone": BoneProbability(np.zeros(3, np.int64), claimed)})["bone"]
    assert look.unclaimed < 0.03 * look.volume


@pytest.mark.parametrize("side", [None, 3.0])
def test_a_bone_that_lost_one_of_its_condyles_is_doubted_there(side) -> None:
    """A shaft that is claimed, and a dim ball beside its end that is not: a twentieth of the marrow."""
    x, y, z = np.indices((70, 60, 60)) * 0.5 - np.array([5.0, 15.0, 15.0])[:, None, None, None]
    shaft = np.hypot(np.hypot(y, z), x - np.clip(x, 0.0, 20.0)) - 2.5
    ball = np.inf if side is None else np.sqrt((x - 20.5) ** 2 + (y - side) ** 2 + z**2) - 2.2
    marrow = np.minimum(shaft, ball)
    values = np.where(marrow < 0.0, np.where(shaft < 0.0, 1.0, 0.55), np.where(marrow < 1.0, 0.05, 0.9))
    claim = BoneProbability(np.zeros(3, np.int64), (shaft < 0.0).astype(np.float32))
    volume = Volume(values.astype(np.float32), np.diag([0.5, 0.5, 0.5, 1.0]))
    look = appearances(volume, {"bone": claim})["bone"]
    if side is None:
        assert look.unclaimed == 0.0 and look.doubts() == []
    else:
        assert 0.03 < look.unclaimed / look.volume < 0.08
        assert np.linalg.norm(np.array(look.unclaimed_at) - [25.5, 18.0, 15.0]) < 2.0
        assert any("look like marrow in the same shell" in doubt for doubt in look.doubts())


def test_a_claim_of_few_voxels_is_doubted() -> None:
    values = np.full((20, 20, 20), 0.05, np.float32)
    values[9:11, 9:11, 9:11] = 1.0
    bone = BoneProbability(np.zeros(3, np.int64), (values > 0.5).astype(np.float32))
    doubts = appearances(Volume(values, np.diag([0.5, 0.5, 0.5, 1])), {"bone": bone})["bone"].doubts()
    assert any("only 1.0 mm^3" in doubt for doubt in doubts)


@pytest.mark.parametrize(("length", "thin"), [(15.9, True), (19.0, True), (25.7, False), (39.8, False)])
def test_a_bone_with_too_few_voxels_across_is_named(length, thin) -> None:
    _, found, marrow, look = drawn_with_marrow(SlimBone(length=length, canal=1.5), seed=1)
    assert look.thin is thin
    assert (dice(found, marrow) < 0.93) == thin


@pytest.mark.parametrize("diameter", [4.0, 8.0])
def test_the_width_of_a_long_cylinder_is_its_diameter(diameter) -> None:
    """At a smooth edge, as a probability has; its ends add little."""
    x, y, _ = np.meshgrid(*(np.arange(n) - (n - 1) / 2 for n in (16, 16, 120)), indexing="ij")
    across = np.clip(0.5 * diameter + 0.5 - np.hypot(x, y), 0, 1)
    bone = BoneProbability(np.zeros(3, np.int64), across.astype(np.float32))
    volume = Volume(across.astype(np.float32), np.eye(4))
    assert appearances(volume, {"bone": bone})["bone"].width == pytest.approx(diameter, rel=0.07)
