"""Conditions of the bones' hard cases are what they are called, seen in the images and by the truth."""

import numpy as np
import pytest
from benchmarks.bones.subject import NEUTRAL, SMALL, Conditions, Scan, scan
from scipy import ndimage

from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.acquisition import image

COARSE = 1.0  # mm, where the voxel size does not matter


def of(pose: str = "hook", **conditions) -> Scan:
    return scan(SMALL.bones, Conditions(**({"spacing": COARSE} | conditions)), pose)


def depth(found: Scan, bone: str, points: np.ndarray) -> np.ndarray:
    """Signed distance in mm of points (n, 3) to a bone's true marrow, negative inside."""
    return Distance(Surface(*found.posed.marrow[bone])).signed(points)[0]


def strokes(found: Scan, bone: str) -> np.ndarray:
    return found.volume.to_world(np.argwhere(found.seeds == found.labels[bone]))


@pytest.mark.parametrize(
    "conditions", [{}, {"slices": 2, "spacing": 0.5}, {"hand": "left"}, {"turned": True}]
)
def test_seeds_lie_in_their_bones(conditions) -> None:
    found = of(**conditions)
    for bone in SMALL.bones:
        assert len(strokes(found, bone)) > 5
        assert depth(found, bone, strokes(found, bone)).max() < 0.3  # slices of 1 mm: half of one beside


def test_thick_slices_hold_the_same_tissue() -> None:
    """Marrow, where it is deeper than a slice, has the same intensity as in thin ones."""
    thick = of(slices=2, spacing=0.5, noise=0.0, bias=0.0).volume
    np.testing.assert_allclose(thick.spacing, [0.5, 0.5, 1.0])
    found = of(spacing=0.5, noise=0.0, bias=0.0)
    points = found.posed.marrow["middle2"][0]
    middle = points.mean(axis=0)
    inside = middle + 0.2 * (points - middle)
    inside = inside[depth(found, "middle2", inside) < -1.2]
    ratio = thick.sample(inside) / found.volume.sample(inside)
    assert len(inside) > 20
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-3)


def test_noise_is_as_large_as_asked_for() -> None:
    """Voxels of pure marrow without a bias field: their deviation over their mean."""
    for noise in (0.03, 0.12):
        found = of(spacing=0.5, noise=noise, bias=0.0)
        voxels = np.argwhere(np.ones(found.volume.shape, bool))
        lower, upper = (
            found.posed.marrow["middle2"][0].min(axis=0),
            found.posed.marrow["middle2"][0].max(axis=0),
        )
        places = found.volume.to_world(voxels)
        near = ((places > lower) & (places < upper)).all(axis=1)
        inside = depth(found, "middle2", places[near]) < -1.0
        values = found.volume.values[tuple(voxels[near][inside].T)]
        assert np.std(values) / np.mean(values) == pytest.approx(noise, rel=0.15)


def test_left_hand_is_the_mirror_image() -> None:
    right, left = of(noise=0.0), of(noise=0.0, hand="left")
    for bone in SMALL.bones:
        np.testing.assert_allclose(left.posed.marrow[bone][0] * [1, -1, 1], right.posed.marrow[bone][0])
    hints = SMALL.dataset("left").joints["DIP2"].axis_hints
    known = next(j for j in left.posed.joints if j.name == "DIP2")
    assert known.axes[0] @ np.array(hints[0]) > 0.9


def test_turned_poses_are_120_degrees_away() -> None:
    usual, turned = of(), of(turned=True)
    for bone in SMALL.bones:
        apart = turned.posed.transforms[bone] @ usual.posed.transforms[bone].inverse()
        assert np.degrees(np.linalg.norm(apart.rotation_vector())) == pytest.approx(120.0)
    rest = of(NEUTRAL, turned=True).posed.transforms["middle2"]
    np.testing.assert_allclose(rest.rotation, np.eye(3))


def test_fused_bones_have_no_gap() -> None:
    """From one marrow to the other there is a way through bright voxels, but none where bones are parted."""
    conditions = {"spacing": 0.5, "noise": 0.0, "bias": 0.0}

    def connected(found: Scan) -> bool:
        level = np.median(found.volume.values[found.seeds == found.labels["middle2"]])
        parts, _ = ndimage.label(found.volume.values > 0.7 * level)
        middle, distal = (parts[found.seeds == found.labels[b]] for b in SMALL.bones)
        return bool(np.bincount(middle).argmax() == np.bincount(distal).argmax())

    assert not connected(of(**conditions))
    assert connected(of(**conditions, fused=("middle2", "distal2")))


@pytest.mark.parametrize(("visible", "least", "most"), [(0.0, 0.0, 0.05), (0.5, 0.3, 0.7)])
def test_volume_ends_where_asked(visible: float, least: float, most: float) -> None:
    found = of("spread", visible=visible)
    inside = (found.posed.bones["distal2"][0] < found.field_of_view[1]).all(axis=1).mean()
    assert least <= inside <= most
    assert (found.seeds == found.labels["distal2"]).any() == (visible > 0)
    assert found.seeds.shape == found.volume.shape


@pytest.mark.parametrize("seeded", ["in the neighbour", "in fat", "partly in fat"])
def test_misled_seeds_lie_elsewhere(seeded: str) -> None:
    found = of("hook", spacing=0.5, misled="distal2", seeded=seeded)
    outside = depth(found, "distal2", strokes(found, "distal2")) > 0.5
    assert outside.sum() > 10
    assert outside.all() == (seeded != "partly in fat")
    if seeded == "in the neighbour":
        assert (depth(found, "middle2", strokes(found, "distal2")) < 0).mean() > 0.9
    else:  # fat is about as bright as marrow, so that intensities alone do not tell
        bright = found.volume.sample(strokes(found, "distal2")[outside]).mean()
        marrow = found.volume.sample(strokes(found, "middle2")).mean()
        assert bright / marrow == pytest.approx(image.INTENSITIES["fat"], abs=0.15)
