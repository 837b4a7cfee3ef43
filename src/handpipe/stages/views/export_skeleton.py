"""The skeleton with the tendons of a scene's frames for MuJoCo and OpenSim, and how near it is."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handpipe.core import Array, Metrics, RigidTransform, metrics
from handpipe.hand import SimulatedFrame, StoredFrames
from handpipe.hand.exports import residual_motion, write_bones, write_mjcf, write_osim
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.tendons import CENTRELINE, Tendon, bone_path

log = logging.getLogger(__name__)
FOLDED = 0.01  # of a tendon's pull: a rod that is compressed more is folded, as no tendon is


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads: tendons, if the scene has the layer."""

    rig: Path
    chunks: Sequence[Path]
    tendons: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    folder: Path
    metrics: Path


@dataclass
class Seen:
    """A tendon's rods (Q+1, 3) in frames, the bones' transforms there, and how many rods were folded."""

    rods: list[Array] = field(default_factory=list)
    poses: list[Mapping[str, RigidTransform]] = field(default_factory=list)
    folded: int = 0


def export_skeleton(inputs: Inputs, outputs: Outputs) -> None:
    """The skeleton with the tendons of a scene's frames for MuJoCo and OpenSim, and how near it is."""
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        rig, seen = Rig.load(inputs.rig), seen_rods(StoredFrames(inputs.chunks))
        paths, found = [], dict(zip(("residual_mean", "residual_max"), residual_motion(rig), strict=True))
        lengths: Metrics = {}
        for tendon in map(Tendon.load, inputs.tendons):
            rods = seen.get(tendon.name, Seen())
            if not rods.rods:
                log.warning("tendon %s is left out: no frame has its rod without folds", tendon.name)
                continue
            path = bone_path(tendon, rods.rods, rods.poses)
            pairs = zip(rods.rods, rods.poses, strict=True)
            errors = [path.length(bones) - path.length_along(rod, bones) for rod, bones in pairs]
            lengths |= metrics.summary(f"{tendon.name}_length_error", np.abs(errors), "mm")
            lengths[f"{tendon.name}_frames"] = (float(len(errors)), "frames")
            lengths[f"{tendon.name}_folded"] = (float(rods.folded), "frames")
            paths.append(path)
        files = write_bones(outputs.folder, rig)
        write_mjcf(outputs.folder, rig, paths, files)
        write_osim(outputs.folder, rig, paths, files)
    residuals: Metrics = {name: (value, "mm") for name, value in found.items()}
    metrics.write(outputs.metrics, residuals | lengths | figures)


def seen_rods(frames: Iterable[SimulatedFrame]) -> dict[str, Seen]:
    """Rods of frames by tendon, without those that are folded."""
    found: dict[str, Seen] = {}
    for frame, layers in frames:
        for body, shape in layers.get("tendons", {}).items():
            if body.endswith(CENTRELINE):
                seen = found.setdefault(body.removesuffix(CENTRELINE), Seen())
                if shape.figures.get("compression", 0.0) > FOLDED:
                    seen.folded += 1
                else:
                    seen.rods.append(shape.vertices)
                    seen.poses.append(frame.bones)
    return found
