import numpy as np
import pytest
from phalanx import SPACING, Phalanx, capsule, grid_points, voxelised

from handpipe.imaging.bone_surfaces.cortical import offset_surface
from handpipe.imaging.bone_surfaces.marrow import Cortex, contour
from handpipe.imaging.bone_surfaces.shell_watershed import Basin, outer_faces, shell_basins

CORTEX = Cortex(level=0.05, marrow=1.0, noise=0.04)


def surface_of(volume, distance):
    """The surface where a signed distance of points vanishes."""
    return contour(volume.like(-distance(grid_points(volume))), 0.0)


@pytest.fixture(scope="module")
def phalanx():
    truth = Phalanx()
    volume = truth.volume()
    marrow = surface_of(volume, truth.marrow)
    return truth, marrow, shell_basins(volume, CORTEX, marrow)


def test_the_basin_is_the_bone(phalanx) -> None:
    """Marrow and shell together, against the analytic bone on the fine grid."""
    truth, _, basins = phalanx
    found, bone = basins.values == Basin.bone, truth.bone(grid_points(basins)) < 0
    assert 2 * (found & bone).sum() / (found.sum() + bone.sum()) > 0.96


def test_faces_that_show_are_found_within_a_voxel(phalanx) -> None:
    truth, marrow, basins = phalanx
    faces = outer_faces(basins, marrow)
    ends = marrow.vertices + faces.offset[:, None] * marrow.vertex_normals()
    error = truth.bone(ends)[faces.seen]
    assert faces.seen.mean() > 0.85
    assert abs(error.mean()) < 0.2 * SPACING
    assert np.abs(error).mean() < 0.35 * SPACING
    assert (np.abs(error) < SPACING).mean() > 0.98


def test_a_tendon_that_touches_is_no_face_and_does_not_leak(phalanx) -> None:
    """Under the tendon's middle no face is reported, and the basin does not flood along the tendon."""
    truth, marrow, basins = phalanx
    faces = outer_faces(basins, marrow)
    x, y, z = marrow.vertices.T
    under = (np.abs(x) < 2.5) & (np.abs(y) < 0.6) & (z < 0)
    assert under.sum() > 20
    assert faces.seen[under].mean() < 0.1
    points = grid_points(basins)
    tendon = (truth.tendon(points) < 0) & (truth.bone(points) > 0)
    assert ((basins.values == Basin.bone) & tendon).sum() < 0.15 * tendon.sum()
    far = truth.bone(points) > 1.5
    assert not ((basins.values == Basin.bone) & far).any()


def test_shells_of_two_bones_without_a_gap_are_shared_midway() -> None:
    """Two capsules whose shells touch; each bone's basin keeps out of the other's marrow and half."""
    ends = ([-9.0, 0, 0], [-3.6, 0, 0]), ([3.6, 0, 0], [9.0, 0, 0])

    def intensity(points):
        inside = np.minimum(capsule(points, *ends[0]), capsule(points, *ends[1]))
        return np.where(inside < 2.8, 1.0, np.where(inside < 3.6, 0.05, 0.6))

    volume = voxelised(intensity, (-15, -7, -7), (15, 7, 7))
    marrows = [surface_of(volume, lambda p, e=e: capsule(p, *e) - 2.8) for e in ends]
    basins = shell_basins(volume, CORTEX, marrows[0], [marrows[1]])
    points = grid_points(basins)
    own = basins.values == Basin.bone
    assert points[own][:, 0].max() < SPACING
    bone = capsule(points, *ends[0]) < 3.6
    assert 2 * (own & bone).sum() / (own.sum() + bone.sum()) > 0.95
    faces = outer_faces(basins, marrows[0])
    tip = marrows[0].vertices[:, 0] > -0.9
    assert tip.sum() > 3
    assert not faces.seen[tip].any()


def test_a_surface_moved_outwards_keeps_its_offset() -> None:
    """A sphere much wider than the band around its surface, moved outwards by more on one side."""
    points_only = voxelised(lambda p: 0 * p[..., 0], (-8, -8, -8), (8, 8, 8), noise=0.0)
    sphere = surface_of(points_only, lambda p: np.linalg.norm(p, axis=-1) - 6.0)
    moved = offset_surface(sphere, 0.7 + 0.05 * sphere.vertices[:, 0], SPACING)
    radius = np.linalg.norm(moved.vertices, axis=1)
    expected = 6.7 + 0.05 * 6.0 * moved.vertices[:, 0] / radius
    assert moved.is_closed()
    assert np.abs(radius - expected).max() < 0.05
