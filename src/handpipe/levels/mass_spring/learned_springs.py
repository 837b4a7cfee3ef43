"""A hand of springs as a page plays it: weights and correctives learned from its own frames."""

from __future__ import annotations

import logging

from handpipe.core import ConvergenceError, Frame
from handpipe.hand import SimulatedFrame
from handpipe.levels.learned_hand import LearnedHand
from handpipe.levels.learning import learn
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
        Poses of these frames. Those in which the springs do not settle are left out; the log names them.

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
    for name, angles in draw_poses(poses, rig).frames.items():
        frame = Frame(name, angles, rig.bone_transforms(angles))
        try:
            frames.append((frame, hand.frame(frame, judged=False)))
        except ConvergenceError as error:
            log.warning("frame %s is not learned: %s", name, error)
    return learn(frames, rig, "springs")
