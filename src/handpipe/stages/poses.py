"""Scanned poses as frames, and the flesh in them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from handpipe.core import Frame, Shape
from handpipe.hand import read_frames
from handpipe.skeleton.rig import Rig


def flesh_in_poses(paths: Iterable[Path]) -> dict[str, Shape]:
    """The flesh's shape in scanned poses, by pose."""
    frames = [read_frames(path)[0] for path in paths]
    return {frame.name: layers["flesh"]["flesh_mesh"] for frame, layers in frames}


def scanned_frame(rig: Rig, pose: str) -> Frame:
    """A scanned pose as the rig explains it, the root at rest."""
    bones = rig.scanned_bones(pose)
    return Frame(pose, rig.poses[pose].angles, bones)
