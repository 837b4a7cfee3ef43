"""Marked bones come back to their place in the image; one that is not there stays marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.configuration.images import Scanner
from handpipe.core.rigid import RigidTransform
from handpipe.imaging.evidence.marrow_evidence import MarrowEvidence
from handpipe.imaging.volumes.volume import Volume, read_volume
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.localisation.locating import HandModel
from handpipe.skeleton.localisation.location_confidence import confidences
from handpipe.skeleton.localisation.second_search import search_again
from handpipe.synthetic.phantom import phantom_hand

CHECKOUT = Path(__file__).parents[2]
BONES = ["metacarpal3", "hamate", "metacarpal5", "proximal5", "middle5", "distal5"]  # the root's body first
MUSCLE = 0.45  # of the marrow's level


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A finger of the phantom hand, bent, in an image of 0.8 mm; the true motions."""
    data = load_dataset(CHECKOUT / "config" / "datasets" / "phantom-hand.yaml")
    data = data.model_copy(
        update={
            "bones": {b: data.bones[b] for b in BONES},
            "joints": {n: j for n, j in data.joints.items() if {j.parent, j.child} <= set(BONES)},
            "root": tmp_path_factory.mktemp("hand"),
            "scanner": Scanner(spacing=0.8),
        }
    )
    phantom_hand.generate_pose(data, "hook")
    bones = artifacts.read(data.path(Path("truth/hook.h5")), "truth")["bones"]
    true = {b: RigidTransform(bones[b]["rotation"], bones[b]["translation"]) for b in BONES}
    known = phantom_hand.hand()
    marrow, whole = ({b: Surface(*part[b]) for b in BONES} for part in (known.marrow, known.bones))
    hand = HandModel.build(data, marrow, whole)
    return hand, read_volume(data.path(data.poses["hook"].volume)), true, whole


def slipped(hand: HandModel, true: RigidTransform, bone: str, by: float) -> RigidTransform:
    """Off its place along its least direction: towards the palm or the back of the hand."""
    points = hand.probes[bone].points
    aside = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    return true @ RigidTransform(np.eye(3), by * aside)


def displacement(hand: HandModel, bone: str, found: RigidTransform, true: RigidTransform) -> float:
    points = hand.probes[bone].points
    return float(np.sqrt(((found(points) - true(points)) ** 2).sum(axis=1).mean()))


def without(volume: Volume, whole: Surface, motion: RigidTransform) -> Volume:
    """The image with muscle in the place of a bone."""
    inside = motion.inverse()(volume.to_world(np.indices(volume.shape).reshape(3, -1).T))
    near = ((inside > whole.vertices.min(axis=0) - 1) & (inside < whole.vertices.max(axis=0) + 1)).all(axis=1)
    values = volume.values.ravel().copy()
    level = np.quantile(values, 0.98)
    place = np.flatnonzero(near)
    values[place[Distance(whole).signed(inside[place])[0] < 0.5]] = MUSCLE * level
    return volume.like(values.reshape(volume.shape))


def test_marked_bones_come_back_parents_first(scan):
    hand, volume, true, _ = scan
    evidence = MarrowEvidence.measure(volume)
    wrong = {
        "proximal5": slipped(hand, true["proximal5"], "proximal5", 4.0),
        "distal5": slipped(hand, true["distal5"], "distal5", 4.0),
    }
    start = true | wrong
    sure = confidences(hand, evidence.fine, start)
    assert {b for b, c in sure.items() if c.marked} >= set(wrong)
    motions, sure = search_again(hand, evidence, start, sure)
    assert not any(c.marked for c in sure.values())
    for bone, motion in motions.items():
        assert displacement(hand, bone, motion, true[bone]) < (0.3 if bone in wrong else 1e-9), bone


def test_sure_bones_stay_where_they_are(scan):
    hand, volume, true, _ = scan
    evidence = MarrowEvidence.measure(volume)
    sure = confidences(hand, evidence.fine, true)
    assert search_again(hand, evidence, true, sure) == (true, sure)


def test_a_bone_that_is_not_there_stays_marked(scan):
    hand, volume, true, whole = scan
    bone = "distal5"
    evidence = MarrowEvidence.measure(without(volume, whole[bone], true[bone]))
    sure = confidences(hand, evidence.fine, true)
    assert sure[bone].marked
    assert search_again(hand, evidence, true, sure)[1][bone].marked
