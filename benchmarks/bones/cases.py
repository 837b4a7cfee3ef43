"""The hard cases of segmentation, registration and rig: what is given to the library in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from benchmarks.bones.subject import FIVE, TWELVE, Conditions

Place = tuple[str, str]
"""A bone in a pose: (pose, bone)."""


@dataclass(frozen=True)
class Case:
    """conditions: of every pose but those in `altered`; poses: NEUTRAL and the others."""

    name: str
    what: str
    conditions: Conditions = Conditions()
    poses: tuple[str, ...] = FIVE
    altered: Mapping[str, Conditions] = field(default_factory=dict)

    def in_pose(self, pose: str) -> Conditions:
        """Conditions of a pose."""
        return self.altered.get(pose, self.conditions)


def _in_one(name: str, what: str, pose: str, conditions: Conditions) -> Case:
    """A case in which one pose of all twelve is another."""
    return Case(name, f"one pose: {what}", poses=TWELVE, altered={pose: conditions})


_CASES = (
    Case("twelve-poses", "all poses, images as the phantom's scanner gives them", poses=TWELVE),
    Case("five-poses", "five poses instead of twelve"),
    Case("noise-2", "five poses, noise doubled", Conditions(noise=0.06)),
    Case("noise-4", "five poses, noise quadrupled", Conditions(noise=0.12)),
    Case("bias-2", "five poses, bias field doubled", Conditions(bias=0.4)),
    Case("voxels-1", "five poses, voxels of 1 mm", Conditions(spacing=1.0)),
    Case("slices-1", "five poses, slices of 1 mm at 0.5 mm in the plane", Conditions(slices=2)),
    Case("turned-120", "five poses, the hand turned by 120° from neutral in each", Conditions(turned=True)),
    Case("left-hand", "five poses of the mirrored hand", Conditions(hand="left")),
    _in_one(
        "fused", "no gap between middle and distal phalanx", "hook", Conditions(fused=("middle2", "distal2"))
    ),
    _in_one(
        "missing",
        "its volume ends before the distal phalanx, which has no seeds",
        "spread",
        Conditions(visible=0.0),
    ),
    _in_one("cut-off", "its volume ends at half of the distal phalanx", "spread", Conditions(visible=0.5)),
    _in_one(
        "seeds-in-neighbour",
        "the middle phalanx's seeds lie in the proximal one",
        "spread",
        Conditions(misled="middle2", seeded="in the neighbour"),
    ),
    _in_one(
        "seeds-in-fat",
        "the middle phalanx's seeds lie in the fat beside it",
        "spread",
        Conditions(misled="middle2", seeded="in fat"),
    ),
    _in_one(
        "seeds-partly-in-fat",
        "one stroke of the middle phalanx's lies in the fat beside it",
        "spread",
        Conditions(misled="middle2", seeded="partly in fat"),
    ),
)
CASES = {case.name: case for case in _CASES}
