"""On the phantom hand, whose joints slide and wobble, the proposed order of scans beats random orders."""

from pathlib import Path

import numpy as np
from manufactured import noisy

from handpipe.core.configuration.dataset import load_dataset
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.joints import fit_joint
from handpipe.skeleton.rig.motions import joint_motions
from handpipe.skeleton.rig.next_pose import RigUncertainty, plan_poses
from handpipe.skeleton.rig.rig import Rig
from handpipe.synthetic.phantom.phantom_hand import posture
from handpipe.synthetic.phantom.phantom_hand_bones import bones

DATASET = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-hand.yaml")
COUNT = 3  # scans after the first


def test_the_proposed_scans_teach_more_than_random_ones():
    surfaces = {name: Surface(*b.surface(b.known.whole, 2.0)) for name, b in bones().items()}
    truth = {p: posture(p, 1).transforms() for p in DATASET.poses}
    rng = np.random.default_rng(0)
    centroids = {b: s.vertices.mean(axis=0) for b, s in surfaces.items()}
    seen = {p: {b: noisy(t, rng, 0.15, 0.05, at=centroids[b]) for b, t in truth[p].items()} for p in truth}
    seen[DATASET.neutral] = truth[DATASET.neutral]
    # The person knows roughly what angles a pose will have; the rig is fitted to the first scan alone.
    rig = Rig.fit(DATASET, seen, surfaces, [DATASET.neutral, "relaxed"])
    angles = {p: rig.poses[p].angles for p in truth if p not in (DATASET.neutral, "relaxed")}
    known = RigUncertainty.of_rig(rig, {"relaxed": rig.poses["relaxed"].angles})
    plan = [name for name, _ in plan_poses(known, angles, COUNT)]

    def error(poses):
        """Root mean square in mm of every other joint in all poses, turns at 12 mm."""
        squares = []
        for joint in [j for j in rig.joints if j.angles][::2]:
            hints = np.array(DATASET.joints[joint.name].axis_hints, float)
            centre = joint.fit.centre
            scans = joint_motions(seen, joint.parent, joint.child, ["relaxed", *poses], centre)
            fit = fit_joint(scans.relative, len(joint.angles), hints, near=centre)
            all_poses = joint_motions(truth, joint.parent, joint.child, list(angles), centre)
            turns, shifts = fit.errors(all_poses.relative, centroids[joint.child])
            squares += list(shifts**2 + (12 * turns) ** 2)
        return np.sqrt(np.mean(squares))

    random = [error(rng.permutation(list(angles))[:COUNT]) for _ in range(6)]
    assert error(plan) < 0.75 * np.mean(random)
    assert error(plan) < np.median(random)
