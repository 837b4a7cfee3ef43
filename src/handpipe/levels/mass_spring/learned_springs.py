"""A hand of springs as a page plays it: weights and correctives learned from its own frames."""

from __future__ import annotations

import logging

from handpipe.core import ConvergenceError, Frame
from handpipe.hand import SimulatedFrame
from handpipe.levels.learned_hand import LearnedHand
from handpipe.levels.learning import EVERY, learn
from handpipe.levels.mass_spring.spring_hand import SpringHand
from handpipe.skeleton.motion import RandomPoses, draw_poses
from handpipe.skeleton.rig import Rig

log = logging.getLogger(__name__)


def learn_springs(hand: SpringHand, rig: Rig, poses: RandomPoses) -> LearnedHand:
    """Learn the levels L0 and L1 from a hand of springs (L2).

    Parameters
    ----------
    hand : SpringHand
        Hand whose frames are learned.
    rig : Rig
        Its joints.
    poses : RandomPoses
        Poses of these frames, besides those of the rig. Where the springs do not settle a frame is left out;
        the log names it.

    Returns
    -------
    LearnedHand
        Skin, muscles and bones. Stated errors are distances from left-out frames of the springs, not from a
        simulation.

    Raises
    ------
    InputError
        If bones collide in nearly all poses, or fewer than ten frames settle.
    """
    frames: list[SimulatedFrame] = []
    for name, angles in _learned_poses(rig, poses):
        frame = Frame(name, angles, rig.bone_transforms(angles))
        try:
            frames.append((frame, hand.frame(frame, judged=False)))
        except ConvergenceError as error:
            log.warning("frame %s is not learned: %s", name, error)
    return learn(frames, rig, "springs")


def _learned_poses(rig: Rig, poses: RandomPoses) -> list[tuple[str, dict[str, float]]]:
    """Angles in rad by name: poses of the rig and random ones; those that `learn` leaves out are random."""
    drawn = iter(draw_poses(poses, rig).frames.items())
    kept = iter([(name, {a: pose.angles[a] for a in rig.angle_names}) for name, pose in rig.poses.items()])
    found: list[tuple[str, dict[str, float]]] = []
    while len(found) < poses.count + len(rig.poses):
        first, second = (drawn, kept) if len(found) % EVERY == EVERY - 1 else (kept, drawn)
        found.append(next(first, None) or next(second))
    return found
