"""The phantom hand's rig from true motions with noise: right and left, of twelve poses and of five."""

from pathlib import Path

import numpy as np
import pytest
from manufactured import noisy

from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration.odd_bones import without_odd_bones
from handpipe.skeleton.rig.rig import Rig
from handpipe.skeleton.rig.table import joint_table
from handpipe.synthetic.phantom.phantom_hand import posture
from handpipe.synthetic.phantom.phantom_hand_bones import bones

CONFIG = Path(__file__).parents[2] / "config/datasets"
RIGHT, LEFT = (load_dataset(CONFIG / f"phantom-hand-{name}.yaml") for name in ("seeded", "left"))
MIRROR = np.array([1.0, -1.0, 1.0])
DEGREES, MM = 0.1, 0.01  # of a registered bone: 0.15 deg and 0.02 mm in all
SURFACES = {name: Surface(*b.surface(b.known.whole, 2.5)) for name, b in bones().items()}
CENTROIDS = {name: s.vertices.mean(axis=0) for name, s in SURFACES.items()}
FEW = ["neutral", "fist", "spread", "bow", "oppose_little"]


@pytest.fixture(scope="module")
def seen():
    """Registered transforms of all poses with their uncertainty."""
    rng = np.random.default_rng(0)
    covariance = np.diag([np.radians(DEGREES) ** 2] * 3 + [MM**2] * 3)
    poses = {}
    for pose in RIGHT.poses:
        found = posture(pose, 1).transforms()
        if pose != "neutral":
            found = {b: noisy(t, rng, DEGREES, MM, at=CENTROIDS[b]) for b, t in found.items()}
        poses[pose] = {b: Registration(t, 0.03, covariance) for b, t in found.items()}
    return poses


def transforms(registrations):
    return {p: {b: r.transform for b, r in found.items()} for p, found in registrations.items()}


def figures(dataset, surfaces, registrations, fit_poses):
    moved = transforms(registrations)
    rig = Rig.fit(dataset, moved, surfaces, fit_poses, registrations)
    table = joint_table(rig, dataset, moved, fit_poses, registrations)
    return rig, {name: value for name, (value, _) in table.metrics.items()}


def test_twelve_poses(seen):
    left, odd = without_odd_bones(RIGHT, transforms(seen), SURFACES, ["neutral", *RIGHT.examples])
    assert not odd and left == transforms(seen)
    _, m = figures(RIGHT, SURFACES, seen, ["neutral", *RIGHT.examples])
    assert m["rotation_error_mean"] < 0.5 and m["translation_error_mean"] < 0.15
    assert m["loo_rotation_error_mean"] < min(1.2, m["loo_partial_rotation_error_mean"])
    assert m["loo_translation_error_mean"] < min(0.35, m["loo_partial_translation_error_mean"])
    assert m["heldout_rotation_error_mean"] < m["heldout_partial_rotation_error_mean"]


def test_five_poses_meet_twice_the_bars(seen):
    _, m = figures(RIGHT, SURFACES, seen, FEW)
    assert m["rotation_error_mean"] < 1.0 and m["translation_error_mean"] < 0.3
    assert m["loo_rotation_error_mean"] < 2.4 and m["loo_translation_error_mean"] < 0.7
    assert m["heldout_rotation_error_mean"] < 1.2 and m["heldout_translation_error_mean"] < 0.35


def test_a_left_hand_and_a_bone_that_two_poses_lack(seen):
    mirrored = {
        p: {
            b: Registration(
                RigidTransform(
                    r.transform.rotation * np.outer(MIRROR, MIRROR), r.transform.translation * MIRROR
                ),
                r.rms,
                r.covariance,
            )
            for b, r in found.items()
        }
        for p, found in seen.items()
    }
    del mirrored["fist"]["middle4"], mirrored["relaxed"]["metacarpal3"]
    surfaces = {b: s.moved(s.vertices * MIRROR).flipped() for b, s in SURFACES.items()}
    rig, m = figures(LEFT, surfaces, mirrored, ["neutral", *LEFT.examples])
    assert m["rotation_error_mean"] < 0.5 and m["loo_rotation_error_mean"] < 1.2
    assert len(next(j for j in rig.joints if j.name == "PIP4").fit.angles) == 5
    # The root moves as one with other bones, which the pose has.
    assert set(rig.poses) == set(LEFT.poses)
    true = posture("relaxed", 1).angles
    for name in ("PIP2_flexion", "PIP4_flexion", "MP3_flexion"):
        assert np.degrees(rig.poses["relaxed"].angles[name] - true[name]) == pytest.approx(0, abs=2.5)
