"""Angles of a scene's frames from keyframes, targets of inverse kinematics or tracked points."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset, Scene
from handpipe.skeleton.drivers import write_angles
from handpipe.skeleton.motion import expand_motion as angles_of_motion
from handpipe.skeleton.posing import PoseValidity, collisions_of
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    motion: Path


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    angles: Path
    metrics: Path
    table: Path


def expand_motion(inputs: Inputs, outputs: Outputs, dataset: Dataset, scene: Scene) -> None:
    """Angles of a scene's frames from keyframes, targets of inverse kinematics or tracked points."""
    rig = Rig.load(inputs.rig)
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        made = angles_of_motion(inputs.motion, rig, hand=dataset.hand, recording=scene.recording)
        colliding = [str(found) for found in collisions_of(PoseValidity(rig), made.frames)]
    for sentence in colliding:
        log.warning("%s: %s", inputs.motion, sentence)
    rows = [{"frame": name, **made.figures.get(name, {})} for name in made.frames]
    write_angles(outputs.angles, made.frames)
    artifacts.write_text(outputs.table, json.dumps({"frames": rows, "said": made.said + colliding}, indent=2))
    metrics.write(outputs.metrics, made.metrics | figures)
