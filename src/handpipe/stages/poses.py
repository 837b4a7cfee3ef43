"""Scanned poses as frames, the flesh in them, and bones that are in doubt there."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from handpipe.core import Frame, Shape
from handpipe.hand import read_frames
from handpipe.skeleton.bones import read_registrations
from handpipe.skeleton.rig import Rig


def flesh_in_poses(paths: Iterable[Path]) -> dict[str, Shape]:
    """The flesh's shape in scanned poses, by pose."""
    frames = [read_frames(path)[0] for path in paths]
    return {frame.name: layers["flesh"]["flesh_mesh"] for frame, layers in frames}


def doubted_bones(registration: Path, bones: Iterable[str]) -> dict[str, str]:
    """Why a pose's registrations of some bones are not to be trusted, by bone."""
    found = read_registrations(registration)
    return {bone: found[bone].doubt for bone in bones if bone in found and found[bone].doubt}


def scanned_frame(rig: Rig, pose: str) -> Frame:
    """A scanned pose as the rig explains it, the root at rest."""
    bones = rig.scanned_bones(pose)
    return Frame(pose, rig.poses[pose].angles, bones)
