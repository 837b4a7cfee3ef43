"""Organs of a generated subject as they truly are in a scanned pose, in place of simulated ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from handpipe.core import Frame, Shape, Shapes
from handpipe.mesh.surfaces import Anchors
from handpipe.skeleton.rig import Rig
from handpipe.stages.truth import surfaces_in, true_motion, true_pose
from handpipe.tissues.tendons import TendonLayer


def with_true_bones(frame: Frame, rig: Rig, truth: Sequence[Path]) -> Frame:
    """A scanned pose with the bones' true transforms, in the frame of the simulation."""
    home = rig.poses[frame.name].root.inverse()
    known = true_pose(truth, frame.name)
    return replace(frame, bones={bone: home @ true_motion(known, bone) for bone in frame.bones})


def true_tendons(layer: TendonLayer, frame: Frame, rig: Rig, truth: Sequence[Path]) -> Shapes:
    """The rods laid along the true centrelines of a scanned pose."""
    home = rig.poses[frame.name].root.inverse()
    known = true_pose(truth, frame.name)["tendons"]
    return layer.along(frame, {name: home(known[name]["centreline"]) for name in layer.tendons})


def true_muscles(
    shapes: Mapping[str, Shape], frame: Frame, rig: Rig, truth: Sequence[Path], neutral: str
) -> Shapes:
    """The muscles' fitted neutral surfaces, each point moved with its place on the true surface.

    The fit's error in neutral stays, so that the motion alone is the truth's.
    """
    home = rig.poses[frame.name].root.inverse()
    rest, posed = (surfaces_in(_muscles(truth, pose)) for pose in (neutral, frame.name))
    found: Shapes = {}
    for name, true in rest.items():
        own = shapes[name]
        moved = Anchors.attach(own.rest, true)(home(posed[name].vertices))
        found[name] = Shape(own.rest, moved, own.cells)
    return found


def _muscles(truth: Sequence[Path], pose: str) -> dict[str, Any]:
    found: dict[str, Any] = true_pose(truth, pose)["muscles"]
    return found
