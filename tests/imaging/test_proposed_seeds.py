"""Seeds from moved bones: inside what they are of, bright, and nothing where nobody is sure."""

from collections.abc import Callable

import igl
import numpy as np
import pytest
from skimage.measure import marching_cubes

from handpipe.imaging.segmentation.proposed_seeds import marrow_core, propose, share_outside
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces.surface import Surface

SPACING = 0.5
SHAPE = (80, 60, 60)
MIDDLES = {1: np.array([11.0, 15.0, 15.0]), 2: np.array([29.0, 15.0, 15.0])}
MARROW, WHOLE = 4.0, 5.0  # mm, radii


def ball(middle: np.ndarray, radius: float) -> Surface:
    vertices, triangles = igl.icosahedron()
    for _ in range(4):
        vertices, triangles = igl.loop(vertices, triangles)
    return Surface(middle + radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), triangles)


def distance(label: int) -> np.ndarray:
    """Distances in mm of every voxel from the middle of a ball."""
    return np.linalg.norm(SPACING * np.moveaxis(np.indices(SHAPE), 0, -1) - MIDDLES[label], axis=-1)


@pytest.fixture
def volume() -> Volume:
    values = np.full(SHAPE, 0.9)
    for label in MIDDLES:
        values[distance(label) < WHOLE] = 0.1
        values[distance(label) < MARROW] = 1.0
    return Volume(values.astype(np.float32), np.diag([SPACING, SPACING, SPACING, 1.0]))


@pytest.fixture
def surfaces() -> tuple[dict[int, Surface], dict[int, Surface]]:
    return ({n: ball(m, MARROW) for n, m in MIDDLES.items()}, {n: ball(m, WHOLE) for n, m in MIDDLES.items()})


def test_the_core_is_an_eroded_marrow(volume, surfaces):
    core = np.zeros(SHAPE, bool)
    core[tuple(marrow_core(volume, surfaces[0][1]).T)] = True
    np.testing.assert_array_equal(core[distance(1) < MARROW - 0.85], True)
    np.testing.assert_array_equal(core[distance(1) > MARROW - 0.55], False)


def test_a_thin_marrow_keeps_its_deepest_voxels(volume):
    thin = marrow_core(volume, ball(MIDDLES[1], 0.8))
    assert 0 < len(thin) <= 4 / 3 * np.pi * 0.8**3 / SPACING**3
    assert (np.linalg.norm(SPACING * thin - MIDDLES[1], axis=1) < 0.5).all()


def waisted(
    middle: np.ndarray, radius: float, along: np.ndarray
) -> tuple[Surface, Callable[[np.ndarray], np.ndarray]]:
    """Two balls joined by a tube along a unit direction, as the base of a distal phalanx and its tuft.

    Also a function that is negative inside.
    """
    ends = [(middle - 3.0 * along, 2.0), (middle + 4.0 * along, 1.0)]

    def inside(points: np.ndarray) -> np.ndarray:
        forwards = (points - middle) @ along
        across = np.linalg.norm(points - middle - forwards[..., None] * along, axis=-1) - radius
        tube = np.maximum(across, np.abs(forwards) - 3)
        return np.min([tube, *(np.linalg.norm(points - c, axis=-1) - r for c, r in ends)], axis=0)

    grid = np.stack(np.meshgrid(*[np.arange(-6, 6.01, 0.2)] * 3, indexing="ij"), axis=-1) + middle
    vertices, faces, _, _ = marching_cubes(inside(grid), 0.0, spacing=(0.2, 0.2, 0.2))
    return Surface(vertices + grid[0, 0, 0], faces), inside


def test_both_sides_of_a_waist_have_seeds(volume):
    marrow, inside = waisted(MIDDLES[1], 0.5, np.array([1.0, 0, 0]))
    seeds = SPACING * marrow_core(volume, marrow)
    assert inside(seeds).max() < 0
    along = seeds[:, 0] - MIDDLES[1][0]
    for low, high in ((-4.0, -2.0), (-1.0, 1.0), (1.4, 4.2)):  # the one ball, the tube, the other
        assert ((along > low) & (along < high)).sum() >= 3


def test_every_slice_of_a_waist_has_seeds(volume):
    """A tube that meets the grid at all places of a voxel: a walk would stop where it has none."""
    along = np.array([1.0, 0.2, 0.15]) / np.linalg.norm([1.0, 0.2, 0.15])
    marrow, inside = waisted(MIDDLES[1], 0.7, along)
    seeds = SPACING * marrow_core(volume, marrow)
    assert inside(seeds).max() < 0
    forwards = (seeds - MIDDLES[1]) @ along
    between = np.sort(forwards[np.abs(forwards) < 3])
    assert np.diff([-3, *between, 3]).max() < 1.2 * SPACING


def test_seeds_lie_in_their_marrow_and_around_all_bones(volume, surfaces):
    seeds = propose(volume, *surfaces)
    assert set(np.unique(seeds)) == {0, 1, 2, 255}
    for label in MIDDLES:
        assert (distance(label)[seeds == label] < MARROW).all()
    nearest = np.minimum(distance(1), distance(2))[seeds == 255] - WHOLE
    assert nearest.min() > 1.0
    assert nearest.max() < 6.9


def test_no_seeds_in_what_is_dark(volume, surfaces):
    dark = np.where(distance(1) < 2, 0.2, volume.values)
    seeds = propose(volume.like(dark), *surfaces)
    assert not (seeds[distance(1) < 2] == 1).any()
    assert (seeds == 1).any()


def test_an_unsure_bone_has_no_seeds_and_may_be_in_any_bright_place(volume, surfaces):
    seeds = propose(volume, *surfaces, unsure=[2])
    assert set(np.unique(seeds)) == {0, 1}  # all that surrounds the balls is bright
    darker = volume.like(np.where(np.minimum(distance(1), distance(2)) > 7, 0.45, volume.values))
    assert set(np.unique(propose(darker, *surfaces, unsure=[2]))) == {0, 1, 255}


def test_a_bone_at_the_border_of_the_volume(volume, surfaces):
    half = volume.crop(np.array([22, 0, 0]), np.array(SHAPE))
    seeds = propose(half, *surfaces)
    np.testing.assert_array_equal(seeds == 1, (propose(volume, *surfaces) == 1)[22:])


def test_share_outside(volume, surfaces):
    truth = (distance(1) < MARROW).astype(np.uint8)
    core = marrow_core(volume, surfaces[0][1])
    assert share_outside(core, truth, 1) == 0
    truth[: int(MIDDLES[1][0] / SPACING)] = 0
    assert share_outside(core, truth, 1) == pytest.approx(0.5, abs=0.1)
    assert share_outside(core[:0], truth, 1) == 1
