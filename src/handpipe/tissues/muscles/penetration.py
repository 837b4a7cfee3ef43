"""How deep muscles lie in bones and in one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces import Distance, Surface, about


@dataclass(frozen=True)
class Posed:
    """A muscle in a frame.

    name, surface: of the muscle; held (v,): vertices that go with a bone; folded: whether it cuts itself.
    """

    name: str
    surface: Surface
    held: BoolArray
    folded: bool

    def inside(self, distance: Distance, points: Array) -> tuple[float, int]:
        """Depth in mm of the deepest of points (k, 3) in this muscle, whose distances are given, and which.

        Depths at triangles of which a bone holds a vertex do not count: they lie in others by design.
        """
        ids = about(points, self.surface, 0.0)
        if not len(ids):
            return 0.0, -1
        signed, triangles, _, _ = distance.signed(points[ids])
        of_bone = np.asarray(self.held[self.surface.triangles[triangles]].any(axis=1))
        return _deepest(signed, of_bone, ids)


@dataclass(frozen=True)
class Penetration:
    """Depths (m,) in mm of muscles in others or others in them, and the place of the deepest in words."""

    depths: Array
    place: str

    @staticmethod
    def of(muscles: Sequence[Posed], bones: Mapping[str, Distance]) -> Penetration:
        """Penetration of muscles with one another and with bones, which have distances to them."""
        distances = [Distance(m.surface, by_winding=m.folded) for m in muscles]
        depths, places = np.zeros(len(muscles)), [""] * len(muscles)

        def note(index: int, depth: float, place: str) -> None:
            if depth > depths[index]:
                depths[index], places[index] = depth, place

        for i, muscle in enumerate(muscles):
            free = muscle.surface.vertices[~muscle.held]
            for name, bone in bones.items():
                if _apart(muscle.surface, bone.surface):
                    continue
                ids = about(free, bone.surface, 0.0)
                if len(ids):
                    signed = bone.signed(free[ids])[0]
                    depth, at = _deepest(signed, np.zeros(len(ids), dtype=bool), ids)
                    note(i, depth, f"{muscle.name} in {name} at {_written(free, at)}")
                depth, at = muscle.inside(distances[i], bone.surface.vertices)
                note(i, depth, f"{name} in {muscle.name} at {_written(bone.surface.vertices, at)}")
            for k, other in enumerate(muscles):
                if k != i and not _apart(muscle.surface, other.surface):
                    depth, at = other.inside(distances[k], free)
                    said = f"{muscle.name} in {other.name} at {_written(free, at)}"
                    note(i, depth, said)
                    note(k, depth, said)
        return Penetration(depths, places[int(depths.argmax())] if len(depths) else "")


def _apart(a: Surface, b: Surface) -> bool:
    """Whether the boxes of two surfaces do not meet."""
    return bool((a.box[0] > b.box[1]).any() or (b.box[0] > a.box[1]).any())


def _deepest(signed: Array, left_out: BoolArray, ids: IntArray) -> tuple[float, int]:
    depths = np.where(left_out, 0.0, -signed)
    at = int(depths.argmax())
    return float(max(depths[at], 0.0)), int(ids[at])


def _written(points: Array, at: int) -> str:
    return "(" + ", ".join(f"{c:.1f}" for c in points[at]) + ") mm"
