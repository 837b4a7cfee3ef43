"""Coupled hands without soft tissue: bones with their marrow, and their motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from handpipe.core.configuration import Dataset
from handpipe.synthetic.family import build_of
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.phantom_hand_joints import WITH_FLESH, joints
from handpipe.synthetic.phantom.posed_hand import Hand, HandMotion
from handpipe.synthetic.real_anatomy import zanatomy_bones
from handpipe.synthetic.real_anatomy.source_meshes import folder_of


@dataclass(frozen=True)
class KnownHand:
    """A hand's joints and poses, and its bones, which are made on demand.

    Parameters
    ----------
    motion : HandMotion
        Joints and poses.
    hand : callable
        Makes the bones with their marrow.
    size : float
        Size of the hand for that of the median generated hand.
    """

    motion: HandMotion
    hand: Callable[[], Hand]
    size: float = 1.0


def known_hand(dataset: Dataset) -> KnownHand:
    """Joints, poses and bones of the hand of a dataset's generator.

    Parameters
    ----------
    dataset : Dataset
        Generated subject: of the generator "zanatomy-hand", else a phantom hand.

    Returns
    -------
    KnownHand
        Joints and poses, and a function that makes the bones.

    Raises
    ------
    InputError
        If the generator's source data are absent, or the dataset names proportions that are not known.
    """
    if dataset.generator == "zanatomy-hand":
        subject = zanatomy_bones.subject(folder_of(dataset))
        return KnownHand(subject.motion, lambda: subject.hand)
    build = None if dataset.proportions is None else build_of(dataset.proportions)
    motion = phantom_hand.motion()
    poses = {name: {**angles, **WITH_FLESH.get(name, {})} for name, angles in motion.poses.items()}
    if build is None:
        return KnownHand(replace(motion, poses=poses), phantom_hand.hand)
    own = {name: build.angles(name, angles) for name, angles in poses.items()}
    motion = HandMotion(dataset.name, joints(build), own)
    return KnownHand(motion, lambda: phantom_hand.hand(build), build.size)
