"""Pose spaces for what varies over a body: at each place the joints around it count, not the whole hand's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.skeleton.posing.pose_space import Interpolation, PoseSpace, ancestry

REACHES = (1, 2)  # joints from a bone to those whose motions are felt around it: the first that suffices
APART = 0.05  # rad: examples nearer to one another are not told apart


@dataclass(frozen=True)
class LocalPoseSpaces:
    """One pose space for each bone, all of the same example poses.

    With one space of all bones, an example that opposes the thumb would change the little finger in every
    pose that opposes it, whatever the little finger does.

    Parameters
    ----------
    spaces : mapping of str to PoseSpace
        Pose space of each bone and its neighbours at joints.
    """

    spaces: Mapping[str, PoseSpace]

    @staticmethod
    def build(
        bones: Sequence[str],
        parents: Mapping[str, str],
        transforms: Mapping[str, Mapping[str, RigidTransform]],
        interpolation: Interpolation = "inverse-distance",
    ) -> LocalPoseSpaces:
        """Spaces of each bone and its neighbours at joints.

        A space includes the bones two joints away where the neighbours alone do not tell the examples apart.

        Parameters
        ----------
        bones, parents, transforms, interpolation
            As for `PoseSpace.build`.

        Returns
        -------
        LocalPoseSpaces
            One space for each of the bones.
        """

        def space(bone: str) -> PoseSpace:
            for reach in REACHES:
                near = [other for other in bones if _joints_between(bone, other, parents) <= reach]
                found = PoseSpace.build(near, parents, transforms, interpolation)
                if found.apart() > APART:
                    break
            return found

        return LocalPoseSpaces({bone: space(bone) for bone in bones})

    def by_inverse_distance(self) -> LocalPoseSpaces:
        """The same spaces with the weights of Zheng 2022 Eq. 1."""
        return LocalPoseSpaces({bone: space.by_inverse_distance() for bone, space in self.spaces.items()})

    def interpolate(
        self, values: Array, near: Mapping[str, Array], bones: Mapping[str, RigidTransform]
    ) -> Array:
        """Values in a pose, interpolated from those at the examples.

        Parameters
        ----------
        values : array (N, m, ...)
            Values of m places at the N examples.
        near : mapping of str to array (m,)
            Share of each bone in a place; the shares of a place sum to one.
        bones : mapping of str to RigidTransform
            Transforms of the pose from neutral.

        Returns
        -------
        array (m, ...)
            Values in the pose.
        """
        weights = sum(np.outer(share, self.spaces[b].weights(bones)) for b, share in near.items())
        return np.einsum("mn,nm...->m...", weights, values)

    def extrapolated(self, bones: Mapping[str, RigidTransform]) -> list[str]:
        """Bones around which a pose is so far from the examples that weights are bounded.

        Parameters
        ----------
        bones : mapping of str to RigidTransform
            Transforms of the pose from neutral.

        Returns
        -------
        list of str
            Names, in the order of the spaces.
        """
        return [bone for bone, space in self.spaces.items() if space.extrapolates(bones)]

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {bone: space.to_group() for bone, space in self.spaces.items()}

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> LocalPoseSpaces:
        """What `to_group` gave, as an artifact returned it."""
        return LocalPoseSpaces({bone: PoseSpace.from_group(space) for bone, space in group.items()})


def _joints_between(one: str, other: str, parents: Mapping[str, str]) -> float:
    """The number of joints on the way from a bone to another; infinite where no joints connect them."""
    up, across = ancestry(one, parents), ancestry(other, parents)
    return min((up.index(bone) + across.index(bone) for bone in up if bone in across), default=np.inf)
