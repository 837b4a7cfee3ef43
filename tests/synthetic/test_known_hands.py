"""Poses of a hand with flesh leave room for it."""

from itertools import combinations
from pathlib import Path

from scipy.spatial import cKDTree

from handpipe.core.configuration.dataset import load_dataset
from handpipe.synthetic.template_hands.known_hands import known_hand

CONFIG = Path(__file__).parents[2] / "config/datasets/phantom-hand-complete.yaml"


def test_fingers_side_by_side_leave_room_for_flesh_in_every_pose() -> None:
    dataset = load_dataset(CONFIG)
    found = known_hand(dataset)
    hand, near = found.hand(), {}
    for pose in found.motion.poses:
        bones = hand.posed(found.motion.posture(pose, dataset.seed)).bones
        fingers = {
            name: cKDTree(vertices)
            for name, (vertices, _) in bones.items()
            if name[-1] in "2345" and name[:-1] in ("proximal", "middle", "distal")
        }
        for a, b in combinations(fingers, 2):
            if a[-1] != b[-1]:
                gap = fingers[a].query(fingers[b].data)[0].min()
                near[pose] = min(gap, near.get(pose, gap))
    assert min(near.values()) > 3.5, near


def test_poses_are_within_the_limits_of_their_angles() -> None:
    dataset = load_dataset(CONFIG)
    limits = {
        angle: bounds
        for joint in dataset.joints.values()
        for angle, bounds in zip(joint.angles, joint.limits_deg, strict=True)
    }
    for angles in known_hand(dataset).motion.poses.values():
        for angle, value in angles.items():
            assert limits[angle][0] <= value <= limits[angle][1], angle
