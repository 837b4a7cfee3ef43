"""A person's template that moves at once: its rig, its springs (L2), and what a page plays of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from handpipe.anatomy.person import SubjectTemplate
from handpipe.anatomy.shipped import ShippedHand
from handpipe.core import Frame
from handpipe.evaluation.player import write_player
from handpipe.hand import write_glb
from handpipe.levels import LearnedHand
from handpipe.levels.mass_spring import Bulging, SpringHand, learn_springs
from handpipe.skeleton.drivers import read_frames
from handpipe.skeleton.motion import RandomPoses, expand_motion, is_motion
from handpipe.skeleton.rig import Rig, StatedJoint, stated_rig
from handpipe.tissues.fat import Rigid, Skin

FLAT = "flat"  # pose of the shipped hand as a hand is photographed
SOURCE = "frames of springs (L2)"  # that the page's levels are learned from
POSES = RandomPoses(count=60, seed=0, around="scans", spread=0.4)  # besides those of the shipped hand


@dataclass(frozen=True)
class PlayedHand:
    """A person's hand without any scan.

    Parameters
    ----------
    template : SubjectTemplate
        The person's template, in the pose in which all angles are zero.
    rig : Rig
        Its joints with the shipped hand's limits; its poses are those of the shipped hand.
    """

    template: SubjectTemplate
    rig: Rig

    @staticmethod
    def of(shipped: ShippedHand, person: SubjectTemplate) -> PlayedHand:
        """The hand of a person's template, with limits and poses of the shipped hand."""
        joints = [
            *(
                StatedJoint(j.name, j.parent, j.child, j.angles, shipped.limits[j.name], j.axes, j.centre)
                for j in person.joints
            ),
            *(StatedJoint(name, *ends) for name, ends in shipped.fixed.items()),
        ]
        rig = stated_rig(joints, person.bones)
        poses = read_frames(shipped.poses, rig)
        return PlayedHand(person, stated_rig(joints, person.bones, poses))

    @property
    def flat(self) -> dict[str, float]:
        """Angles in rad of the hand as it lies flat."""
        return self.rig.poses[FLAT].angles

    @cached_property
    def skin(self) -> Skin:
        """Skin with its nails, which are rigid."""
        surface = self.template.skin
        if surface is None:
            raise ValueError("the shipped hand has a skin")
        nails = {
            f"nail_{bone}": Rigid(bone, np.unique(surface.triangles[ids]))
            for bone, ids in self.template.nails.items()
        }
        return Skin(surface, nails)

    @cached_property
    def springs(self) -> SpringHand:
        """The hand at L2."""
        muscles = [Bulging(name, muscle) for name, muscle in self.template.muscles.items()]
        return SpringHand.of(self.rig, self.skin, muscles)

    @cached_property
    def learned(self) -> LearnedHand:
        """The levels that a page plays, learned from the hand at L2."""
        return learn_springs(self.springs, self.rig, POSES)

    def write_page(self, path: Path, name: str) -> None:
        """Write the page that moves the hand."""
        write_player(path, name, self.learned, self.rig, self.template.side, SOURCE)

    def write_motion(self, path: Path, motion: Path) -> int:
        """Write frames at L2 as animated glTF; the number of frames.

        motion: table of angles or contractions, targets, landmarks, or any other file of a scene's frames.
        """
        side = self.template.side
        if is_motion(motion):
            driven: Mapping[str, dict[str, float]] = expand_motion(motion, self.rig, hand=side).frames
        else:
            driven = read_frames(motion, self.rig, hand=side)
        frames = [Frame(name, angles, self.rig.bone_transforms(angles)) for name, angles in driven.items()]
        write_glb(path, [(frame, self.springs.frame(frame, judged=False)) for frame in frames])
        return len(frames)
