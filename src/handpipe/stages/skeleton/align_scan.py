"""A scan in its own frame, aligned to the skin in the volume of its pose."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import InputError, Metrics, metrics
from handpipe.core.configuration import Dataset
from handpipe.imaging.skin import PosedBones, VolumeSkin, skin_of_volume
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.files import read_scan, write_surface
from handpipe.mesh.surfaces import each_moved
from handpipe.skeleton import scan_alignment
from handpipe.skeleton.rig import Rig
from handpipe.skeleton.scan_alignment import Alignment, ImageSkin, require_same_hand, require_same_size
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    scan: Path
    volume: Path
    rig: Path
    neutral: Path | None = None


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    scan: Path
    metrics: Path


def align_scan(inputs: Inputs, outputs: Outputs, dataset: Dataset, pose: str) -> None:
    """A scan in its own frame, aligned to the skin in the volume of its pose."""
    figures: Metrics = {}
    with metrics.measured(figures):
        scan, rig = read_scan(inputs.scan), Rig.load(inputs.rig)
        seen = _skin(inputs, dataset, pose, rig)
        require_same_size(inputs.scan, scan, seen.closed)
        target = ImageSkin.build(seen, rig, pose)
        found = scan_alignment.align_scan(scan, target)
    figures |= _figures(found)
    log.info(
        "%s: %s", pose, ", ".join(f"{name} {value:.3g} {unit}" for name, (value, unit) in figures.items())
    )
    require_same_hand(inputs.scan, found)
    write_surface(outputs.scan, found.surface)
    metrics.write(outputs.metrics, figures)


def _skin(inputs: Inputs, dataset: Dataset, pose: str, rig: Rig) -> VolumeSkin:
    """The skin in the pose's volume; bones and the neutral skin tell parts that touch apart."""
    known = rig.scanned_bones(pose)
    motions = {bone: rig.poses[pose].root @ moved for bone, moved in known.items()}
    surfaces = each_moved({bone: rig.surfaces[bone] for bone in motions}, motions)
    joints = [(j.parent, j.child) for j in rig.joints if j.child in motions]
    neutral = None if inputs.neutral is None else read_scan(inputs.neutral)
    try:
        return skin_of_volume(pose_volume(dataset, pose), PosedBones(surfaces, joints, motions, neutral))
    except InputError as error:
        if error.source != "volume":
            raise
        raise InputError(inputs.volume, error.field, error.problem, error.remedy) from error


def _figures(found: Alignment) -> Metrics:
    turn = np.degrees(np.linalg.norm(found.motion.rotation_vector()))
    middle = found.surface.vertices.mean(axis=0)
    figures: Metrics = {
        "rotation": (float(turn), "deg"),
        "shift": (float(np.linalg.norm(middle - found.motion.inverse()(middle))), "mm"),
        "distance_before_smoothing": (found.residual, "mm"),
        "distance": (found.left, "mm"),
        "off_skin": (found.off, "1"),
        "volume_ratio": (found.volume_ratio, "1"),
    }
    return figures | {f"turn_{joint}": (angle, "deg") for joint, angle in found.joint_angles.items()}
