"""Limits of joint angles from the poses that were seen, widened by published ranges of motion.

The ranges are the clinical ones of the American Academy of Orthopaedic Surgeons (Clinical Measurement of
Joint Motion, 2nd edition, 2011), as the MIT-licensed hand-anatomy-explorer compiles them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.joint_tree import JointTree, RigJoint

Limits = dict[str, tuple[float, float]]
MARGIN = np.radians(3.0)  # beyond the seen range where no range is published: the error of a registered angle

# (joint, ray or None for every finger, motion): degrees, flexion towards the palm positive, zero straight.
RANGES: dict[tuple[str, int | None, str], tuple[float, float]] = {
    ("CMC", 1, "flexion"): (-15, 20),
    ("CMC", 1, "abduction"): (-30, 50),
    ("MP", 1, "flexion"): (-10, 50),
    ("IP", 1, "flexion"): (-25, 80),
    ("MP", None, "flexion"): (-30, 90),
    ("MP", 2, "abduction"): (-20, 20),
    ("MP", 3, "abduction"): (-15, 15),
    ("MP", 4, "abduction"): (-20, 20),
    ("MP", 5, "abduction"): (-30, 30),
    ("PIP", None, "flexion"): (0, 100),
    ("DIP", None, "flexion"): (-20, 70),
}
ALIASES = {"TM": ("CMC", 1), "MCP": ("MP", None)}
LONG = 2.5  # variance along a bone over the next one, from which it has a long axis


def reference_range(angle: str) -> tuple[float, float] | None:
    """Published range in rad of an angle that is named like MP2_flexion, TM_abduction or MCP5_flexion.

    None where nothing is published of it, or its name says nothing.
    """
    match = re.fullmatch(r"([A-Z]+)([1-5])?_(flexion|abduction)", angle)
    if match is None:
        return None
    joint, ray = ALIASES.get(match[1], (match[1], None))
    ray = int(match[2]) if match[2] else ray
    every = None if ray == 1 else RANGES.get((joint, None, match[3]))
    degrees = RANGES.get((joint, ray, match[3]), every)
    return None if degrees is None else (float(np.radians(degrees[0])), float(np.radians(degrees[1])))


@dataclass(frozen=True)
class AngleRange:
    """What is known of an angle's range, in rad: seen in the rig's poses, published, None if it is not."""

    seen: tuple[float, float]
    reference: tuple[float, float] | None

    @property
    def widened(self) -> tuple[float, float]:
        """What was seen and a margin, and all that is published besides."""
        lower, upper = self.seen[0] - MARGIN, self.seen[1] + MARGIN
        if self.reference is None:
            return lower, upper
        return min(lower, self.reference[0]), max(upper, self.reference[1])


def angle_ranges(rig: JointTree) -> dict[str, AngleRange]:
    """Seen and published range of every angle.

    References measure flexion from the straight finger, a rig from its neutral pose: their range is moved by
    the bend that the bones have in neutral. Abduction is taken from neutral as it is.
    """
    ranges = {}
    for joint in rig.joints:
        for index, name in enumerate(joint.angles):
            seen = [0.0, *(p.known[name] for p in rig.poses.values() if name in p.known)]
            published = reference_range(name)
            if published is not None:
                bend = neutral_bend(rig, joint, index) if name.endswith("flexion") else 0.0
                published = (published[0] - bend, published[1] - bend)
            ranges[name] = AngleRange((float(min(seen)), float(max(seen))), published)
    return ranges


def widened_limits(rig: JointTree) -> Limits:
    """Limits in rad of every angle: what the rig's poses show, and all that the references allow besides."""
    return {name: angle.widened for name, angle in angle_ranges(rig).items()}


def limit_rows(rig: JointTree) -> list[dict[str, str | float]]:
    """A table of the limits of a rig's angles, one row per angle.

    Parameters
    ----------
    rig : JointTree
        Rig with its scanned poses.

    Returns
    -------
    list of dict
        Rows with `angle` and, in deg, the lower and upper end of the range in the rig's poses (`seen_lower`,
        `seen_upper`), of the published range (`reference_…`, absent if none is published) and of the limits
        in use (`limit_…`).
    """
    rows = []
    for name, angle in angle_ranges(rig).items():
        row: dict[str, str | float] = {"angle": name}
        ranges = {"seen": angle.seen, "reference": angle.reference, "limit": rig.limits[name]}
        for kind, pair in ranges.items():
            if pair is not None:
                lower, upper = np.degrees(pair)
                row |= {f"{kind}_lower": float(lower), f"{kind}_upper": float(upper)}
        rows.append(row)
    return rows


def seen_ranges(poses: Mapping[str, Angles]) -> Limits:
    """Least and largest value in rad of every angle over poses that determine it; neutral's zero is one."""
    names = dict.fromkeys(n for angles in poses.values() for n in angles)
    values = {n: [0.0, *(angles[n] for angles in poses.values() if n in angles)] for n in names}
    return {n: (min(v), max(v)) for n, v in values.items()}


def neutral_bend(rig: JointTree, joint: RigJoint, index: int) -> float:
    """Angle in rad about one of the joint's axes from the parent's long axis to the child's, in neutral.

    Zero where a bone has no long axis, as a carpal has none.
    """
    parent, child = long_axis(rig.surfaces[joint.parent]), long_axis(rig.surfaces[joint.child])
    if parent is None or child is None:
        return 0.0
    middles = [rig.surfaces[bone].vertices.mean(axis=0) for bone in (joint.parent, joint.child)]
    outwards = middles[1] - middles[0]
    axis = joint.fit.axes.directions[index]
    a, b = (v * np.sign(v @ outwards) for v in (parent, child))
    a, b = a - (a @ axis) * axis, b - (b @ axis) * axis
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b))


def long_axis(surface: Surface) -> Array | None:
    """Direction (3,) along which a bone is longest, None where it is hardly longer than wide."""
    values, vectors = np.linalg.eigh(np.cov(surface.vertices.T))
    return vectors[:, 2] if values[2] > LONG * values[1] else None
