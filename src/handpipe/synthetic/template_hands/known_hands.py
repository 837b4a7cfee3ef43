"""What is known of a coupled hand without any soft tissue: its bones with their marrow, and how they move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from handpipe.core.configuration import Dataset
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.phantom_hand_joints import WITH_FLESH
from handpipe.synthetic.phantom.posed_hand import Hand, Motion
from handpipe.synthetic.real_anatomy import zanatomy_bones
from handpipe.synthetic.real_anatomy.source_meshes import folder_of


@dataclass(frozen=True)
class KnownHand:
    """A hand's joints and poses, and its bones, which are made when they are asked for."""

    motion: Motion
    hand: Callable[[], Hand]


def known_hand(dataset: Dataset) -> KnownHand:
    """The hand of a dataset's generator; `InputError` where its source data are absent."""
    if dataset.generator == "zanatomy-hand":
        subject = zanatomy_bones.subject(folder_of(dataset))
        return KnownHand(subject.motion, lambda: subject.hand)
    motion = phantom_hand.motion()
    poses = {name: {**angles, **WITH_FLESH.get(name, {})} for name, angles in motion.poses.items()}
    return KnownHand(replace(motion, poses=poses), phantom_hand.hand)
