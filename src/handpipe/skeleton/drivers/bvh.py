"""Biovision hierarchies (BVH): a skeleton's offsets and its joints' rotations in frames, read and written.

Rotations are degrees by the format; offsets have whatever unit their author used, and only their shape
counts here. All joints' axes are parallel at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, InputError, read_text, write_text
from handpipe.skeleton.joints.frame_table import number_in

POSITIONS = ("Xposition", "Yposition", "Zposition")
ROTATIONS = ("Xrotation", "Yrotation", "Zrotation")


@dataclass(frozen=True)
class BvhJoint:
    """A joint in the hierarchy of a BVH file.

    Parameters
    ----------
    name : str
        Its name.
    parent : str or None
        Name of its parent, None for the root.
    offset : array (3,)
        Offset from the parent in units of the file.
    channels : tuple of str
        Names of its channels in the order of the file.
    end : array (3,), optional
        Offset of its `End Site`, if it has one.
    """

    name: str
    parent: str | None
    offset: Array
    channels: tuple[str, ...]
    end: Array | None = None


@dataclass(frozen=True)
class Bvh:
    """A skeleton with its frames, as a BVH file has them.

    Parameters
    ----------
    joints : tuple of BvhJoint
        Joints, parents before children.
    values : array (frames, channels)
        Values of all joints' channels in the order of the file, rotations in degrees.
    seconds : float
        Time of a frame.
    """

    joints: tuple[BvhJoint, ...]
    values: Array
    seconds: float

    @property
    def places(self) -> dict[str, Array]:
        """Where each joint (3,) is at rest."""
        places: dict[str, Array] = {}
        for joint in self.joints:
            places[joint.name] = joint.offset + (0 if joint.parent is None else places[joint.parent])
        return places

    def rotations(self) -> dict[str, Array]:
        """Each joint's rotations (frames, 3, 3) from rest, its ancestors' included.

        The channels of a joint turn in their order, each about the axes that those before have turned.
        """
        turned: dict[str, Array] = {}
        first = 0
        for joint in self.joints:
            local = np.broadcast_to(np.eye(3), (len(self.values), 3, 3))
            for column, channel in enumerate(joint.channels, start=first):
                if channel in ROTATIONS:
                    axis = np.eye(3)[ROTATIONS.index(channel)]
                    angles = np.radians(self.values[:, column])
                    local = local @ Rotation.from_rotvec(angles[:, None] * axis).as_matrix()
            first += len(joint.channels)
            turned[joint.name] = local if joint.parent is None else turned[joint.parent] @ local
        return turned


def read_bvh(path: str | Path) -> Bvh:
    """Read a BVH file; raises `InputError` naming the line of what is wrong."""
    lines = _Lines(path, read_text(path))
    if lines.next() != ["HIERARCHY"]:
        raise lines.error("does not begin with HIERARCHY")
    joints: list[BvhJoint] = []
    if (first := lines.next())[0] != "ROOT":
        raise lines.error("has no ROOT")
    try:
        _read_joint(lines, " ".join(first[1:]), None, joints)
    except RecursionError:
        raise lines.error("is in joints that are nested too deep") from None
    return _read_motion(lines, tuple(joints))


class _Lines:
    """Words of the lines that are not empty, with the number of the last one."""

    def __init__(self, path: str | Path, text: str) -> None:
        self.path, self.number = path, 0
        self._lines: Iterator[tuple[int, str]] = iter(enumerate(text.splitlines(), start=1))

    def next(self) -> list[str]:
        for number, line in self._lines:
            self.number = number
            if line.strip():
                return line.split()
        raise self.error("ends too early")

    def rest(self) -> Iterator[list[str]]:
        """Words of all further lines."""
        for number, line in self._lines:
            self.number = number
            if line.strip():
                yield line.split()

    def numbers(self, words: Sequence[str], count: int) -> Array:
        try:
            values = np.array([number_in(w) for w in words])
        except ValueError as error:
            raise self.error(f"has something that is not a number ({error})") from error
        if len(values) != count or not np.isfinite(values).all():
            raise self.error(f"needs {count} finite numbers, not {len(values)}")
        return values

    def error(self, problem: str) -> InputError:
        return InputError(self.path, f"line {self.number}", problem, "Export the BVH file anew")


def _read_joint(lines: _Lines, name: str, parent: str | None, joints: list[BvhJoint]) -> None:
    """One joint with all below it, from its opening brace to its closing one."""
    if not name or name in {j.name for j in joints}:
        raise lines.error(f"names a second joint {name!r}" if name else "has a joint without a name")
    if lines.next() != ["{"]:
        raise lines.error("should be an opening brace")
    place = len(joints)
    joint = BvhJoint(name, parent, np.zeros(3), ())
    joints.append(joint)
    while (words := lines.next()) != ["}"]:
        if words[0] == "OFFSET":
            joint = BvhJoint(name, parent, lines.numbers(words[1:], 3), joint.channels, joint.end)
        elif words[0] == "CHANNELS":
            joint = BvhJoint(name, parent, joint.offset, _channels(lines, words[1:]), joint.end)
        elif words[0] == "JOINT":
            _read_joint(lines, " ".join(words[1:]), name, joints)
        elif words == ["End", "Site"]:
            joint = BvhJoint(name, parent, joint.offset, joint.channels, _end_site(lines))
        else:
            raise lines.error(f"has the unknown word {words[0]!r}")
        joints[place] = joint


def _channels(lines: _Lines, words: Sequence[str]) -> tuple[str, ...]:
    if not words or words[0] != str(len(words) - 1):
        raise lines.error("gives another number of channels than it names")
    for word in words[1:]:
        if word not in POSITIONS + ROTATIONS:
            raise lines.error(f"has the unknown channel {word!r}")
    return tuple(words[1:])


def _end_site(lines: _Lines) -> Array:
    if lines.next() != ["{"]:
        raise lines.error("should be an opening brace")
    words = lines.next()
    if words[0] != "OFFSET":
        raise lines.error("should be the OFFSET of an End Site")
    offset = lines.numbers(words[1:], 3)
    if lines.next() != ["}"]:
        raise lines.error("should be a closing brace")
    return offset


def _read_motion(lines: _Lines, joints: tuple[BvhJoint, ...]) -> Bvh:
    if lines.next() != ["MOTION"]:
        raise lines.error("should be MOTION")
    if (words := lines.next())[0] != "Frames:":
        raise lines.error("should be the number of Frames:")
    [count] = lines.numbers(words[1:], 1)
    if count != int(count) or count < 1:
        raise lines.error("is no number of frames, one at least")
    stated = lines.number
    if (words := lines.next())[:2] != ["Frame", "Time:"]:
        raise lines.error("should be the Frame Time:")
    seconds = float(lines.numbers(words[2:], 1)[0])
    channels = sum(len(j.channels) for j in joints)
    rows = [lines.numbers(words, channels) for words in lines.rest()]
    if len(rows) != count:
        problem = f"line {stated} gives {count:.0f} frames, but {len(rows)} rows follow"
        raise InputError(lines.path, "Frames", problem, "Correct the number, or export the file anew")
    values = np.array(rows)
    return Bvh(joints, values, seconds)


def write_bvh(path: str | Path, bvh: Bvh) -> None:
    """Write a BVH file, atomically."""
    children: Mapping[str | None, list[BvhJoint]] = {
        j.name: [c for c in bvh.joints if c.parent == j.name] for j in bvh.joints
    }
    lines = ["HIERARCHY", *_joint_lines(bvh.joints[0], children, 0), "MOTION"]
    lines += [f"Frames: {len(bvh.values)}", f"Frame Time: {bvh.seconds:.6f}"]
    lines += [" ".join(f"{v:.6f}" for v in row) for row in bvh.values]
    write_text(path, "\n".join(lines) + "\n")


def _joint_lines(joint: BvhJoint, children: Mapping[str | None, list[BvhJoint]], depth: int) -> list[str]:
    tab, inner = "  " * depth, "  " * (depth + 1)
    lines = [f"{tab}{'JOINT' if joint.parent is not None else 'ROOT'} {joint.name}", f"{tab}{{"]
    lines += [f"{inner}OFFSET {_numbers(joint.offset)}"]
    lines += [f"{inner}CHANNELS {len(joint.channels)} {' '.join(joint.channels)}"]
    for child in children[joint.name]:
        lines += _joint_lines(child, children, depth + 1)
    if joint.end is not None:
        lines += [f"{inner}End Site", f"{inner}{{", f"{inner}  OFFSET {_numbers(joint.end)}", f"{inner}}}"]
    return [*lines, f"{tab}}}"]


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.6f}" for v in values)
