"""Bones learned from strokes: a generated joint of dark marrow and bright cartilage, whose truth is known.

As in gradient-echo images: marrow and cortex darker than muscle, cartilage bright, a tendon as dark as bone,
fat in between; a receive coil's fall-off makes far muscle darker than near marrow.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from phalanx import capsule, grid_points, voxelised

from handpipe.core import InputError
from handpipe.imaging.bone_surfaces import outline_surface
from handpipe.imaging.learned import learned_appearances, learned_doubts, segment_learned
from handpipe.imaging.segmentation import BACKGROUND, SegmentationSettings, claims, segment
from handpipe.imaging.volumes import Volume

LOWER, UPPER, SPACING = (-26.0, -16.0, -16.0), (26.0, 16.0, 16.0), 1.0
LABELS = {"proximal": 1, "distal": 2}
RADIUS = {"proximal": 7.0, "distal": 6.0}
ENDS = {"proximal": ((-17.0, 0, 0), (-8.5, 0, 0)), "distal": ((8.0, 0, 0), (17.0, 0, 0))}
CARTILAGE, FAT, TENDON = 1.3, 2.0, ((-26.0, -10.5, 0), (26.0, -10.5, 0))


def distance(name, points):
    """Negative in a bone."""
    return capsule(points, *ENDS[name]) - RADIUS[name]


def intensity(points):
    """Intensities of the tissues, by the coil's fall-off along x and z."""
    bones = np.minimum(distance("proximal", points), distance("distal", points))
    texture = 0.03 * np.prod(np.sin(points * [2.1, 1.9, 1.7]), axis=-1)
    value = np.where(points[..., 2] > 9.0, 0.8, 1.0)  # fat above muscle
    value = np.where(capsule(points, *TENDON) < FAT, 0.15, value)
    joint = (bones < CARTILAGE) & (np.abs(points[..., 0]) < 9.0)
    value = np.where(joint, 1.2, value)
    value = np.where(bones < 0, 0.4 + texture, value)
    value = np.where((bones < 0) & (bones > -0.8), 0.2, value)
    return value * np.exp(-(points[..., 0] + 26.0) / 40.0 - (points[..., 2] + 16.0) / 80.0)


def strokes(volume, planes=(-4, 0, 4)):
    """Lines within the bones and around them, in some slices along z."""
    points = grid_points(volume)
    seeds = np.zeros(volume.shape, np.uint8)
    drawn = np.isin(np.round(points[..., 2]), planes)
    both = {name: distance(name, points) for name in LABELS}
    nearest = np.minimum(*both.values())
    lines = np.abs(nearest - 2.2) < 0.5
    joint = (np.abs(points[..., 0]) < 0.6) & (np.abs(points[..., 1]) < 9)
    tendon = np.abs(points[..., 1] + 10.5) < 0.6
    sides = (np.abs(np.abs(points[..., 1]) - 13) < 0.6) | (np.abs(np.abs(points[..., 0]) - 25) < 0.6)
    seeds[drawn & (lines & (nearest > 1.5) | joint | tendon | sides) & (nearest > 1.2)] = BACKGROUND
    for name, label in LABELS.items():
        seeds[drawn & (np.abs(both[name] + 2.0) < 0.5)] = label
    above = (np.abs(np.abs(points[..., 2]) - 12) < 0.6) & (np.abs(points[..., 1]) < 0.6)
    seeds[above] = BACKGROUND
    return seeds


@pytest.fixture(scope="module")
def joint():
    volume = voxelised(intensity, LOWER, UPPER, noise=0.01, spacing=SPACING)
    return volume, strokes(volume)


@pytest.fixture(scope="module")
def found(joint):
    bones, wrong = segment_learned([joint[0]], joint[1], LABELS)
    assert not wrong
    return bones


def claimed(volume, bone):
    out = np.zeros(volume.shape, bool)
    out[bone.slices] = bone.probability > 0.5
    return out


def dice(a, b):
    return 2 * (a & b).sum() / (a.sum() + b.sum())


def test_coil_makes_near_marrow_brighter_than_far_muscle(joint) -> None:
    """Or no test here is one of a fall-off."""
    volume, _ = joint
    near, far = volume.sample(np.array([[-12.0, 0, -4], [24.0, 12, 6]]))
    assert near > far


def test_bones_are_found(joint, found) -> None:
    volume, _ = joint
    for name in LABELS:
        truth = distance(name, grid_points(volume)) < 0
        assert dice(claimed(volume, found[name]), truth) > 0.95


def test_surfaces_are_closed_and_below_half_a_voxel(joint, found) -> None:
    for name in LABELS:
        surface = outline_surface(joint[0], found[name])
        error = distance(name, surface.vertices)
        assert surface.is_closed()
        assert np.abs(error).mean() < 0.3 * SPACING
        assert np.quantile(np.abs(error), 0.99) < 1.2 * SPACING


def test_bones_do_not_overlap_and_leave_their_strokes(joint, found) -> None:
    volume, seeds = joint
    masks = {name: claimed(volume, bone) for name, bone in found.items()}
    assert not (masks["proximal"] & masks["distal"]).any()
    assert not (masks["proximal"] | masks["distal"])[seeds == BACKGROUND].any()
    for name, label in LABELS.items():
        assert masks[name][seeds == label].mean() > 0.99


def test_marrow_that_has_to_be_bright_is_not_found(joint) -> None:
    """What the other contrast makes of this image: nothing, or bones in doubt."""
    volume, seeds = joint
    bones, wrong = segment(volume, seeds, LABELS, SegmentationSettings())
    wrong |= claims.doubted(claims.appearances(volume, bones), {})
    assert set(wrong) == set(LABELS)


def test_good_strokes_are_trusted(joint, found) -> None:
    assert learned_doubts(found) == {}
    assert claims.doubted(learned_appearances(joint[0], found), {}) == {}


def test_strokes_of_a_part_suffice_where_the_look_decides(joint) -> None:
    """Strokes at the bones' far ends alone, none in the joint: its look continues the bone."""
    volume, seeds = joint
    points = grid_points(volume)
    few = np.where((seeds > 0) & (seeds < BACKGROUND) & (np.abs(points[..., 0]) < 12), 0, seeds)
    few[(few == BACKGROUND) & (np.abs(points[..., 0]) < 18)] = 0
    bones, wrong = segment_learned([volume], few, LABELS)
    assert wrong | learned_doubts(bones) == {}
    for name in LABELS:
        assert dice(claimed(volume, bones[name]), distance(name, points) < 0) > 0.95


def test_strokes_that_do_not_decide_are_doubted(joint) -> None:
    """A line in the middle of each bone and strokes far away leave every border in between to chance."""
    volume, _ = joint
    points = grid_points(volume)
    seeds = np.zeros(volume.shape, np.uint8)
    for name, label in LABELS.items():
        seeds[np.abs(distance(name, points) + RADIUS[name] - 1) < 0.5] = label
    seeds[np.abs(points[..., 1]) > 14] = BACKGROUND
    bones, wrong = segment_learned([volume], seeds, LABELS)
    doubts = wrong | learned_doubts(bones)
    assert set(doubts) == set(LABELS)
    assert all("draw" in text for text in doubts.values())


def test_doubts_are_only_logged_once_a_person_has_corrected(joint, found) -> None:
    loose = {name: replace(bone, trust=(0.3, 0.5, 0.5, 0.0)) for name, bone in found.items()}
    assert set(learned_doubts(loose)) == set(LABELS)
    assert set(learned_doubts(loose, ["proximal"])) == {"distal"}


def test_second_channel_helps_where_the_first_shows_nothing(joint) -> None:
    """A channel of noise alone beside the image changes little; alone it decides nothing."""
    volume, seeds = joint
    noise = volume.like(np.random.default_rng(1).random(volume.shape))
    bones, _ = segment_learned([volume, noise], seeds, LABELS)
    truth = distance("proximal", grid_points(volume)) < 0
    assert dice(claimed(volume, bones["proximal"]), truth) > 0.9


def test_confidence_is_written_and_read(found, tmp_path) -> None:
    claims.save(tmp_path / "bones.h5", found)
    read = claims.load(tmp_path / "bones.h5")
    assert {name: bone.trust for name, bone in read.items()} == {n: b.trust for n, b in found.items()}


def test_strokes_that_teach_nothing_are_refused(joint) -> None:
    volume, seeds = joint
    with pytest.raises(InputError, match="background"):
        segment_learned([volume], np.where(seeds == BACKGROUND, 0, seeds), LABELS)


def test_bone_without_strokes_is_named(joint) -> None:
    volume, seeds = joint
    bones, wrong = segment_learned([volume], seeds, LABELS | {"middle": 3})
    assert set(bones) == set(LABELS)
    assert "draw" in wrong["middle"]


def test_a_tenth_as_bright_an_image_gives_the_same(joint, found) -> None:
    volume, seeds = joint
    bones, _ = segment_learned([Volume(volume.values * 0.1, volume.affine)], seeds, LABELS)
    for name in LABELS:
        assert dice(claimed(volume, bones[name]), claimed(volume, found[name])) > 0.999
