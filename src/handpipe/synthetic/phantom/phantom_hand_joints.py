"""The phantom hand's 17 joints with 23 degrees of freedom (Wang 2019, Fig. 8), and its twelve poses.

Eleven joints of one degree of freedom: DIP and PIP of four fingers, the thumb's IP, CMC IV and V. Six of two:
MP of all rays and the thumb's TM. Metacarpals II and III and the distal carpals move as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.synthetic.geometry.kinematics import KnownJoint
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.phantom_hand_bones import FINGERS, facet_centre, frames, rays, saddle_centre

# Motions that no pure hinge has, at their largest: a turn in deg and a shift in mm; distal, radial, dorsal.
RESIDUALS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "TM": ((3.0, 0.7, -1.8), (0.25, -0.2, -0.35)),
    "MP": ((2.8, 0.0, 1.4), (0.2, 0.15, -0.4)),
    "PIP": ((2.2, 0.0, -1.3), (0.15, 0.1, -0.4)),
    "DIP": ((-1.9, 0.0, 1.1), (0.08, 0.05, -0.28)),
    "IP": ((-2.2, 0.0, 1.4), (0.12, 0.05, -0.3)),
    "CMC": ((1.5, 0.0, 1.6), (0.08, 0.12, -0.2)),
}
# Axes in the child's frame at rest, flexion first; slightly oblique, as bones' axes are.
AXES: dict[str, Sequence[tuple[float, float, float]]] = {
    "TM": ((0.3, 1.0, 0.1), (-0.1, -0.05, 1.0)),
    "MP": ((0.05, 1.0, 0.03), (0.06, 0.0, 1.0)),
    "PIP": ((-0.07, 1.0, 0.05),),
    "DIP": ((0.06, 1.0, -0.04),),
    "IP": ((0.1, 1.0, -0.06),),
    "CMC": ((0.15, 1.0, 0.1),),
}


def _joint(kind: str, ray: int, parent: str, child: str, centre: Array, frame: RigidTransform) -> KnownJoint:
    """A joint of a kind at a centre in the neutral frame; `frame` is the child's."""
    name = kind if kind == "TM" else f"{kind}{ray}"
    axes = np.array(AXES[kind]) / np.linalg.norm(AXES[kind], axis=1, keepdims=True)
    # Rays differ: each has a residual of its own size, and every other one leans to the other side.
    turn, shift = (np.array(r) for r in RESIDUALS[kind])
    side = np.array([1.0, 1.0, -1.0 if ray % 2 else 1.0]) * (0.8 + 0.08 * ray)
    return KnownJoint(
        name,
        parent,
        child,
        tuple(f"{name}_{motion}" for motion in ("flexion", "abduction")[: len(axes)]),
        axes @ frame.rotation.T,
        centre,
        frame.rotation @ np.radians(side * turn),
        frame.rotation @ shift,
        frame.rotation[:, 0],
    )


def joints(build: HandBuild | None = None) -> tuple[KnownJoint, ...]:
    """All joints, each after the one that carries its parent; the first one's parent is the root bone.

    Those of another hand than the median one are at its size.
    """
    placed, segments = frames(build), rays(build)
    found: list[KnownJoint] = []

    def add(kind: str, ray: int, parent: str, child: str, centre: Array) -> None:
        found.append(_joint(kind, ray, parent, child, centre, placed[child]))

    for ray in (3, 2, 4, 5):
        if ray > 3:
            add("CMC", ray, "hamate", f"metacarpal{ray}", facet_centre(ray))
        chain = [f"{kind}{ray}" for kind in segments[ray]]
        for joint, parent, child, segment in zip(
            ("MP", "PIP", "DIP"), chain[:-1], chain[1:], segments[ray].values(), strict=False
        ):
            add(joint, ray, parent, child, placed[parent](segment.head()))
    add("TM", 1, "trapezium", "metacarpal1", saddle_centre())
    for joint, parent, child in (("MP", "metacarpal", "proximal"), ("IP", "proximal", "distal")):
        add(joint, 1, f"{parent}1", f"{child}1", placed[f"{parent}1"](segments[1][parent].head()))
    return tuple(found if build is None else (_varied(joint, build) for joint in found))


def _varied(joint: KnownJoint, build: HandBuild) -> KnownJoint:
    """A joint of another hand at its size: its axes lean elsewhere, its centre lies elsewhere."""
    turn, share = build.joint_turn(joint.name), build.residual(joint.name)
    return replace(
        joint,
        axes=joint.axes @ turn.T,
        centre=build.size * (build.shaped(joint.centre[None])[0] + build.joint_shift(joint.name)),
        residual_rotation=share * joint.residual_rotation,
        residual_translation=share * build.size * joint.residual_translation,
    )


Finger = tuple[float, float, float, float]
Thumb = tuple[float, float, float, float, float]


def _pose(
    thumb: Thumb, index: Finger, middle: Finger, ring: Finger, little: Finger, palm: tuple[float, float]
) -> dict[str, float]:
    """Angles in degrees by name.

    thumb: TM flexion and abduction, MP flexion and abduction, IP; fingers: MP flexion and abduction, PIP,
    DIP; palm: CMC IV and V.
    """
    of_thumb = ("TM_flexion", "TM_abduction", "MP1_flexion", "MP1_abduction", "IP1_flexion")
    angles = dict(zip(of_thumb, thumb, strict=True))
    for ray, values in zip(FINGERS, (index, middle, ring, little), strict=True):
        names = (f"MP{ray}_flexion", f"MP{ray}_abduction", f"PIP{ray}_flexion", f"DIP{ray}_flexion")
        angles |= dict(zip(names, values, strict=True))
    return angles | dict(zip(("CMC4_flexion", "CMC5_flexion"), palm, strict=True))


STILL: Finger = (0, 0, 0, 0)  # deg, a finger at rest
POSES = {
    "neutral": _pose((0, 0, 0, 0, 0), STILL, STILL, STILL, STILL, (0, 0)),
    "fist": _pose(
        (12, -8, 30, -4, 45), (66, 2, 88, 48), (68, 0, 90, 52), (66, -1, 88, 50), (64, 2, 84, 48), (7, 14)
    ),
    "hook": _pose(
        (-6, 8, 10, 3, 30), (4, 8, 82, 50), (0, 2, 84, 48), (6, -7, 82, 46), (18, -13, 78, 50), (1, 3)
    ),
    "flat": _pose(
        (-12, -6, -8, 0, -14),
        (-22, -3, -12, -6),
        (-22, 0, -14, -6),
        (-24, 2, -14, -7),
        (-26, 6, -14, -8),
        (-2, -4),
    ),
    "spread": _pose(
        (-10, 26, -4, 8, -6),
        (-6, 14, -6, -2),
        (-8, 2, -8, -4),
        (-8, -10, -8, -2),
        (-6, -20, -6, -4),
        (-1, -3),
    ),
    "oppose_little": _pose(
        (26, 11, 44, -8, 31), (20, 4, 20, 8), (26, 0, 26, 10), (34, -2, 30, 12), (60, 12, 18, 0), (9, 18)
    ),
    "bow": _pose((8, 16, 14, 6, 10), (64, -6, 8, 2), (70, 2, 6, 4), (68, 6, 6, 2), (62, -8, 4, 0), (5, 10)),
    "oppose_index": _pose(
        (23, 4, 28, -12, -20), (69, -12, 5, 0), (12, 0, 14, 6), (8, -2, 10, 4), (4, -4, 8, 4), (1, 2)
    ),
    "oppose_middle": _pose(
        (28, 4, 33, -12, -20), (18, 6, 16, 6), (74, -12, 4, 0), (16, 0, 16, 6), (10, -3, 12, 6), (3, 5)
    ),
    "oppose_ring": _pose(
        (29, 4, 39, -12, -20), (16, 5, 16, 6), (24, 2, 22, 8), (69, -12, 0, 1), (24, 2, 20, 8), (6, 10)
    ),
    "point": _pose(
        (14, 6, 22, 0, 34), (-8, 3, -6, -4), (60, 0, 82, 40), (62, 0, 84, 42), (58, 3, 80, 42), (6, 12)
    ),
    "relaxed": _pose(
        (4, 10, 8, 2, 12), (16, 3, 24, 12), (22, 1, 28, 14), (26, -1, 32, 16), (30, -4, 34, 18), (3, 7)
    ),
}
# Between those: on the way to the relaxed hand, a little spread. To test what is learned from few poses.
BETWEEN = {
    "loose": {
        name: round(0.6 * bent + 0.3 * POSES["spread"][name], 1) for name, bent in POSES["relaxed"].items()
    }
}
# What is different where fingers have flesh: their bones stay 3.7 mm apart; bare ones come within 0.6 mm.
WITH_FLESH = {
    "fist": {"MP2_abduction": 1, "MP4_abduction": -15, "MP5_abduction": -11}
    | {"CMC4_flexion": 14, "CMC5_flexion": 9},
    "bow": {"MP2_abduction": 15, "MP3_abduction": -3, "MP4_abduction": 8, "MP5_abduction": -6}
    | {"CMC4_flexion": 14},
    "oppose_middle": {"MP4_abduction": -1, "CMC4_flexion": -2},
    "oppose_ring": {"MP2_abduction": 7, "MP3_abduction": 0, "MP5_abduction": 1}
    | {"CMC4_flexion": 10, "CMC5_flexion": 5},
    "point": {"MP3_abduction": -5, "MP4_abduction": -6, "MP5_abduction": -9}
    | {"CMC4_flexion": -5, "CMC5_flexion": 13},
}
