"""The hard cases of segmentation, registration and rig: what is given to the library in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from benchmarks.bones.misled import Seeding
from benchmarks.bones.subject import FIVE, TWELVE, Conditions

Place = tuple[str, str]
"""A bone in a pose: (pose, bone)."""


@dataclass(frozen=True)
class Case:
    """conditions: of every pose but those in `altered`; poses: NEUTRAL and the others; wrong: the one bone of
    which something is wrong in what is given, where there is one."""

    name: str
    what: str
    conditions: Conditions = Conditions()
    poses: tuple[str, ...] = FIVE
    altered: Mapping[str, Conditions] = field(default_factory=dict)
    wrong: Place | None = None

    def of(self, pose: str) -> Conditions:
        """Conditions of a pose."""
        return self.altered.get(pose, self.conditions)


def _misled(name: str, what: str, seeded: Seeding) -> Case:
    """A case with wrong seeds of the middle phalanx in one pose."""
    wrong = Conditions(misled="middle2", seeded=seeded)
    return Case(name, what, altered={"hook": wrong}, wrong=("hook", "middle2"))


_CASES = (
    Case("twelve-poses", "all poses, images as the phantom's scanner gives them", poses=TWELVE),
    Case("five-poses", "five poses instead of twelve: what the cases below change"),
    Case("noise-2", "noise doubled", Conditions(noise=0.06)),
    Case("noise-4", "noise quadrupled", Conditions(noise=0.12)),
    Case("bias-2", "bias field doubled", Conditions(bias=0.4)),
    Case("voxels-1", "voxels of 1 mm", Conditions(spacing=1.0)),
    Case("slices-1", "slices of 1 mm at 0.5 mm in the plane", Conditions(slices=2)),
    Case("turned-120", "the hand lies turned by 120° from neutral in every pose", Conditions(turned=True)),
    Case("left-hand", "the mirrored hand", Conditions(hand="left")),
    Case(
        "fused",
        "no gap between middle and distal phalanx in one pose",
        altered={"hook": Conditions(fused=("middle2", "distal2"))},
    ),
    Case(
        "missing",
        "one pose's volume ends before the distal phalanx, which has no seeds",
        altered={"spread": Conditions(visible=0.0)},
        wrong=("spread", "distal2"),
    ),
    Case(
        "cut-off",
        "one pose's volume ends at half of the distal phalanx",
        altered={"spread": Conditions(visible=0.5)},
    ),
    _misled("seeds-in-neighbour", "a bone's seeds lie in its neighbour, in one pose", "in the neighbour"),
    _misled("seeds-in-fat", "a bone's seeds lie in the fat beside it, in one pose", "in fat"),
    _misled("seeds-partly-in-fat", "one stroke of several lies in the fat, in one pose", "partly in fat"),
)
CASES = {case.name: case for case in _CASES}
