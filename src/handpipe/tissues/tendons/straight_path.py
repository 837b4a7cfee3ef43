"""A tendon as straight lines through points that bones carry, for programs without rods that slide.

Such a program can carry a hook by one bone alone. Where a tendon goes over from bone to bone, hooks of both
pass each other when the joint bends, and the lines would fold. Therefore the last hook on one bone and the
first on the next are those between which a straight line is as long as the rod, in the frames that are given;
hooks between them are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.tissues.tendons.fitting.hooks import past_end
from handpipe.tissues.tendons.rods.rod import arc_length, closest_on_rod
from handpipe.tissues.tendons.tendon import Tendon

Bones = Mapping[str, RigidTransform]


@dataclass(frozen=True)
class BonePath:
    """Points of a tendon, from the insertion outwards.

    Parameters
    ----------
    name : str
        Name of the tendon.
    radius : float
        Its radius in mm.
    bones : tuple of str
        Bone that carries each point.
    points : array (k, 3)
        Points in neutral, mm.
    """

    name: str
    radius: float
    bones: tuple[str, ...]
    points: Array

    def carried(self, bones: Bones) -> Array:
        """Points (k, 3) in mm with bones that are moved from neutral."""
        return np.array([bones[bone](point) for bone, point in zip(self.bones, self.points, strict=True)])

    def length(self, bones: Bones) -> float:
        """Length in mm of the straight lines from point to point."""
        return float(np.linalg.norm(np.diff(self.carried(bones), axis=0), axis=1).sum())

    def length_along(self, rod: Array, bones: Bones) -> float:
        """Length in mm of a simulated rod (Q+1, 3) from the insertion to where the last point is beside it.

        A rod that ends before goes on straight.
        """
        return float(_along(past_end(rod), self.carried(bones)[-1:])[0][0])


def bone_path(tendon: Tendon, rods: Sequence[Array], poses: Sequence[Bones]) -> BonePath:
    """The path whose straight lines are nearest to a tendon's rods.

    Parameters
    ----------
    tendon : Tendon
        Tendon with its hooks.
    rods : sequence of array (Q+1, 3)
        Its rods in frames, mm.
    poses : sequence of mapping of str to RigidTransform
        Transforms of the bones from neutral in each of these frames.

    Returns
    -------
    BonePath
        From the rod's first vertex over hooks to its last one. A hook belongs to the bone of its largest
        weight.
    """
    order, rest = tendon.hooks.bones, tendon.hooks.rest
    arcs = _along(tendon.rest.x, rest)[0]
    sequence = np.argsort(arcs, kind="stable")
    owners = np.maximum.accumulate(tendon.hooks.weights.argmax(axis=1)[sequence])
    groups = [sequence[owners == bone] for bone in range(len(order))]
    passed = [bone for bone in range(len(order)) if len(groups[bone])]
    owner = np.empty_like(owners)
    owner[sequence] = owners
    costs = _costs(rest, [order[bone] for bone in owner], rods, poses)
    start, stop = np.zeros(len(order), int), np.array([len(group) for group in groups])
    for bone, following in zip(passed, passed[1:], strict=False):
        # The last half of a bone's hooks and the first one of the next bone's: of each bone one is left.
        half = len(groups[bone]) // 2
        last, first = groups[bone][half:], groups[following][: (len(groups[following]) + 1) // 2]
        nearest = np.argmin(costs[np.ix_(last, first)])
        stop[bone], start[following] = half + nearest // len(first) + 1, nearest % len(first)
    kept = {bone: groups[bone][start[bone] : stop[bone]] for bone in passed}
    chosen = [tendon.rest.x[:1], *(rest[kept[bone]] for bone in passed), tendon.rest.x[-1:]]
    names = [order[bone] for bone in passed for _ in kept[bone]]
    return BonePath(tendon.name, tendon.radius, (order[0], *names, order[-1]), np.concatenate(chosen))


def _costs(rest: Array, owners: Sequence[str], rods: Sequence[Array], poses: Sequence[Bones]) -> Array:
    """Squared errors in mm² of lines from hook to hook (k, k), over frames: of length and of both ends."""
    total = np.zeros((len(rest), len(rest)))
    for rod, bones in zip(rods, poses, strict=True):
        points = np.array([bones[bone](point) for bone, point in zip(owners, rest, strict=True)])
        arcs, distances = _along(past_end(rod), points)
        lines = np.linalg.norm(points[:, None] - points[None], axis=2)
        total += (lines - (arcs[None] - arcs[:, None])) ** 2
        total += distances[:, None] ** 2 + distances[None] ** 2
    return total


def _along(x: Array, points: Array) -> tuple[Array, Array]:
    """Length (k,) in mm along a curve (n, 3) to what is closest to points (k, 3), and the distances (k,)."""
    segment, t, distance = closest_on_rod(points, x)
    arcs = arc_length(x)
    return arcs[segment] + t * (arcs[segment + 1] - arcs[segment]), distance
