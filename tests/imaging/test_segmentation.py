import numpy as np
import pytest
from phalanx import Phalanx, capsule, grid_points, voxelised

from handpipe.core.errors import InputError
from handpipe.imaging.bone_surfaces.cortical import whole_bone
from handpipe.imaging.bone_surfaces.marrow import contour, marrow_surface
from handpipe.imaging.segmentation.merging import merge
from handpipe.imaging.segmentation.segmentation import (
    BACKGROUND,
    BoneProbability,
    SegmentationSettings,
    add_scribbles,
    check_seeds,
    segment_bone,
)
from handpipe.imaging.volumes.rasterisation import rasterise
from handpipe.imaging.volumes.volume import Volume

SETTINGS = SegmentationSettings()


def dice(a, b):
    return 2 * (a & b).sum() / (a.sum() + b.sum())


@pytest.fixture(scope="module")
def phalanx():
    truth = Phalanx()
    volume = truth.volume()
    return truth, volume, segment_bone(volume, truth.seeds(volume), 1, SETTINGS)


@pytest.fixture(scope="module")
def marrow(phalanx):
    _, volume, bone = phalanx
    return marrow_surface(volume, bone)


def test_marrow_is_found(phalanx) -> None:
    truth, volume, bone = phalanx
    found = np.zeros(volume.shape, bool)
    found[bone.slices] = bone.probability > 0.5
    assert dice(found, truth.marrow(grid_points(volume)) < 0) > 0.97


def test_marrow_surface_is_closed_and_below_a_tenth_of_a_voxel(phalanx, marrow) -> None:
    truth = phalanx[0]
    error = truth.marrow(marrow.vertices)
    assert marrow.is_closed()
    assert marrow.volume() > 0
    assert np.abs(error).mean() < 0.05
    assert np.abs(error).max() < 0.3


def test_marrow_surface_does_not_depend_on_the_grids_orientation(phalanx, marrow) -> None:
    truth, volume, bone = phalanx
    turn = np.array([[0.0, -1, 0, 5], [1, 0, 0, -3], [0, 0, 1, 2], [0, 0, 0, 1]])
    turned = marrow_surface(Volume(volume.values, turn @ volume.affine), bone)
    expected = marrow.vertices @ turn[:3, :3].T + turn[:3, 3]
    np.testing.assert_allclose(turned.vertices, expected, atol=1e-3)


def test_a_waist_of_two_voxels_does_not_part_the_marrow() -> None:
    """Two balls joined by an oblique tube, as the base of a small distal phalanx and its tuft."""
    along = np.array([1.0, 0.2, 0.15]) / np.linalg.norm([1.0, 0.2, 0.15])

    def inside(points):
        tube = capsule(points, -5 * along, 5 * along) - 0.5
        balls = [np.linalg.norm(points - c * along, axis=-1) - r for c, r in ((-5, 2.2), (5, 1.2))]
        return np.minimum(tube, np.minimum(*balls))

    def intensity(points):
        depth = inside(points)
        return np.select([depth < 0, depth < 1.0], [1.0, 0.08], 0.8)

    volume = voxelised(intensity, [-10, -6, -6], [10, 6, 6])
    true = inside(grid_points(volume))
    seeds = np.select([true < -0.25, true > 2], [1, BACKGROUND], 0).astype(np.uint8)
    marrow = marrow_surface(volume, segment_bone(volume, seeds, 1, SETTINGS))
    assert np.ptp(marrow.vertices @ along) == pytest.approx(13.4, abs=0.2)
    assert np.abs(inside(marrow.vertices)).mean() < 0.05
    assert dice(rasterise(volume, {1: marrow}) == 1, true < 0) > 0.95


def test_whole_bone_where_a_tendon_touches_it(phalanx, marrow) -> None:
    truth, volume, bone = phalanx
    whole = whole_bone(volume, bone, marrow)
    error = truth.bone(whole.vertices)
    touched = truth.tendon(whole.vertices) < 0.3
    labels = rasterise(volume, {1: whole})
    assert whole.is_closed()
    assert dice(labels == 1, truth.bone(grid_points(volume)) < 0) > 0.98
    assert np.abs(error).mean() < 0.06
    assert touched.sum() > 10
    assert np.abs(error[touched]).max() < 0.4


def test_seeds_that_touch_darkness_do_no_harm(phalanx) -> None:
    """A stroke drawn too far, through the shell, does not open the bone."""
    truth, volume, _ = phalanx
    seeds = truth.seeds(volume)
    stroke = capsule(grid_points(volume), [0, 0, 0], [0, 0, 5]) < 0.4
    seeds[stroke] = 1
    bone = segment_bone(volume, seeds, 1, SETTINGS)
    found = np.zeros(volume.shape, bool)
    found[bone.slices] = bone.probability > 0.5
    assert dice(found, truth.marrow(grid_points(volume)) < 0) > 0.97


def test_the_region_grows_to_hold_the_marrow(phalanx) -> None:
    truth, volume, _ = phalanx
    seeds = truth.seeds(volume)
    points = grid_points(volume)
    seeds[(seeds == 1) & (points[..., 0] > -4)] = 0
    bone = segment_bone(volume, seeds, 1, SegmentationSettings(margin=2.0))
    found = np.zeros(volume.shape, bool)
    found[bone.slices] = bone.probability > 0.5
    assert dice(found, truth.marrow(points) < 0) > 0.97


def two_touching_bones():
    """Two marrow capsules with a gap in the shell between them, and seeds of both."""
    a, b = ([-9.0, 0, 0], [-3.0, 0, 0]), ([3.0, 0, 0], [9.0, 0, 0])

    def intensity(points):
        inside = np.minimum(capsule(points, *a), capsule(points, *b))
        value = np.where(inside < 4.0, 0.05, 0.6)
        hole = (np.abs(points[..., 0]) < 1.5) & (np.hypot(points[..., 1], points[..., 2]) < 0.9)
        return np.where((inside < 3.0) | hole, 1.0, value)

    volume = voxelised(intensity, (-15, -7, -7), (15, 7, 7))
    points = grid_points(volume)
    seeds = np.zeros(volume.shape, np.uint8)
    seeds[capsule(points, *a) < 0.8] = 1
    seeds[capsule(points, *b) < 0.8] = 2
    seeds[:, :2] = seeds[:, -2:] = BACKGROUND
    truth = np.where(capsule(points, *a) < 3.0, 1, np.where(capsule(points, *b) < 3.0, 2, 0))
    return volume, seeds, truth


def test_bones_that_touch_are_told_apart() -> None:
    volume, seeds, truth = two_touching_bones()
    bones = {label: segment_bone(volume, seeds, label, SETTINGS) for label in (1, 2)}
    labels, _ = merge(volume, bones, seeds, SETTINGS)
    assert dice(labels == 1, truth == 1) > 0.95
    assert dice(labels == 2, truth == 2) > 0.95


def test_a_conflict_is_resolved_by_the_sure_voxels_around_it() -> None:
    """Both bones claim a slab of the other; after merging each voxel has one owner, in both outputs."""
    volume, seeds, truth = two_touching_bones()
    x = grid_points(volume)[..., 0]
    claims = {1: (truth == 1) | ((truth == 2) & (x < 2)), 2: (truth == 2) | ((truth == 1) & (x > -2))}
    zero = np.zeros(3, np.int64)
    bones = {k: BoneProbability(zero, c.astype(np.float32)) for k, c in claims.items()}
    labels, resolved = merge(volume, bones, seeds, SETTINGS)
    assert not ((resolved[1].probability > 0.5) & (resolved[2].probability > 0.5)).any()
    assert (labels == 1).sum() > 0.9 * (truth == 1).sum()
    for label in (1, 2):
        assert dice(labels == label, truth == label) > 0.95
        assert dice(resolved[label].probability > 0.5, labels == label) > 0.99


def test_scribbles_overrule_seeds(phalanx) -> None:
    truth, volume, _ = phalanx
    seeds = truth.seeds(volume)
    scribbles = np.zeros_like(seeds)
    scribbles[grid_points(volume)[..., 0] > 4] = BACKGROUND
    bone = segment_bone(volume, add_scribbles(seeds, scribbles), 1, SETTINGS)
    claimed = np.argwhere(bone.probability > 0.5) + bone.offset
    assert volume.to_world(claimed)[:, 0].max() <= 4.0


@pytest.mark.parametrize("case", ["bone", "background", "unknown"])
def test_bad_seeds_are_named(case) -> None:
    seeds = np.zeros((4, 4, 4), np.uint8)
    seeds[0], seeds[1], seeds[2] = 1, 2, BACKGROUND
    seeds[{"bone": 1, "background": 2, "unknown": 3}[case]] = {"bone": 0, "background": 0, "unknown": 7}[case]
    with pytest.raises(InputError) as caught:
        check_seeds("seeds.nii.gz", seeds, {"proximal2": 1, "distal2": 2})
    assert caught.value.source == "seeds.nii.gz"
    assert {"bone": "distal2", "background": "255", "unknown": "7"}[case] in caught.value.problem


def test_a_contour_of_nothing_is_an_error() -> None:
    with pytest.raises(InputError):
        contour(Volume(np.zeros((4, 4, 4), np.float32), np.eye(4)), 0.5)
