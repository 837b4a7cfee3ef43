"""Bones that pass through one another during a motion, by the frames in which they do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.posing.validity import Pair, PoseValidity


@dataclass(frozen=True)
class Collision:
    """Two bones in one another in successive frames.

    Parameters
    ----------
    bones : tuple of str
        The two bones.
    first, last : str
        Names of the first and the last of these frames.
    depth : float
        Largest depth in mm, beyond that in neutral.
    """

    bones: Pair
    first: str
    last: str
    depth: float

    def __str__(self) -> str:
        """One sentence that says what to do."""
        frames = self.first if self.first == self.last else f"{self.first} to {self.last}"
        one, other = self.bones
        return (
            f"{frames}: {one} and {other} lie up to {self.depth:.1f} mm in one another, which leaves their "
            "tissue no room. Change the angles there, or add a key that leads one around the other"
        )


def collisions_of(validity: PoseValidity, frames: Mapping[str, Angles]) -> list[Collision]:
    """Bones that lie in one another in frames of a motion.

    Parameters
    ----------
    validity : PoseValidity
        Check of single poses.
    frames : mapping of str to mapping of str to float
        Angles in rad by frame, in the order of time.

    Returns
    -------
    list of Collision
        One for each pair of bones and run of frames, in the order of their last frames.
    """
    ended: list[Collision] = []
    lasting: dict[Pair, Collision] = {}
    for name, angles in frames.items():
        found = validity.check(angles).collisions
        ended += [lasting.pop(pair) for pair in lasting.keys() - found]
        for pair, depth in found.items():
            run = lasting.get(pair, Collision(pair, name, name, 0.0))
            lasting[pair] = Collision(pair, run.first, name, max(run.depth, depth))
    return [*ended, *lasting.values()]
