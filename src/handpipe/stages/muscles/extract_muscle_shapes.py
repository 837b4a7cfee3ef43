"""Shapes of all muscles in the example poses (Zheng 2022 §4.4, stage 1)."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from handpipe.core import Array, artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import labelled_muscles
from handpipe.imaging.evidence import read_landmarks, read_markers
from handpipe.imaging.volumes import pose_volume
from handpipe.skeleton.bones import read_registration
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_bodies
from handpipe.stages.poses import doubted_bones, flesh_in_poses
from handpipe.tissues.muscles.fitting import PoseData, extract_poses

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    neutral: Path
    volumes: Sequence[Path]
    registrations: Sequence[Path]
    flesh: Sequence[Path]
    markers: Sequence[Path]
    landmarks: Sequence[Path]
    labels: Sequence[Path] = ()


def extract_muscle_shapes(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """Shapes of all muscles in the example poses (Zheng 2022 §4.4, stage 1)."""
    rig = Rig.load(inputs.rig)
    bones = rig.surfaces
    transforms = {
        pose: read_registration(path, bones)
        for pose, path in zip(dataset.examples, inputs.registrations, strict=True)
    }
    flesh = {
        pose: replace(shape, vertices=rig.poses[pose].root(shape.vertices))
        for pose, shape in flesh_in_poses(inputs.flesh).items()
    }
    poses = {
        pose: PoseData(
            moved,
            partial(pose_volume, dataset, pose),
            _points(dataset, pose),
            {m: read_landmarks(dataset.path(path)) for m, path in dataset.poses[pose].landmarks.items()},
            flesh.get(pose),
        )
        for pose, moved in transforms.items()
    }
    bodies = read_bodies(inputs.neutral)
    for pose, path in zip(dataset.examples, inputs.registrations, strict=True):
        for muscle, body in bodies.items():
            for bone, doubt in doubted_bones(path, body.attachments).items():
                log.warning("%s in %s is in doubt: it follows %s, and %s", muscle, pose, bone, doubt)
    found = extract_poses(bodies, bones, poses)
    data = {
        pose: {m: {"vertices": e.surface.vertices, "mesh_vertices": e.vertices} for m, e in muscles.items()}
        for pose, muscles in found.items()
    }
    units = {f"{p}/{m}/{k}": "mm" for p, ms in data.items() for m, ks in ms.items() for k in ks}
    artifacts.write(output, data, kind="muscle_shapes", units=units, inputs=inputs.all())


def _points(dataset: Dataset, pose: str) -> dict[str, Array]:
    """Points (n, 3) in mm on muscles in a pose: markers that a person placed, else of the label map."""
    given = dataset.poses[pose]
    drawn = labelled_muscles(dataset.path(given.labels), dataset) if given.labels else {}
    return drawn | {m: read_markers(dataset.path(path))[0] for m, path in given.markers.items()}
