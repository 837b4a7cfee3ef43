"""The neutral shape of one muscle, from its placed template and the image (Wang 2021 §5.3 and 5.4)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import labelled_muscles
from handpipe.imaging.evidence import read_landmarks, read_markers
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.surfaces import Distance, concatenate
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_guesses, write_bodies
from handpipe.tissues.muscles.fitting import Evidence, extract_neutral

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    templates: Path
    volume: Path
    markers: Path | None
    landmarks: Path | None
    labels: Path | None = None


def extract_muscle(inputs: Inputs, output: Path, dataset: Dataset, name: str) -> None:
    """The neutral shape of one muscle, from its placed template and the image (Wang 2021 §5.3 and 5.4)."""
    guesses = read_guesses(inputs.templates, dataset.muscles)
    others = [guess.surface for other, guess in guesses.items() if other != name]
    points = labelled_muscles(inputs.labels, dataset).get(name)
    if inputs.markers:
        points = read_markers(inputs.markers)[0]
    evidence = Evidence(
        pose_volume(dataset, dataset.neutral),
        others=others,
        bones=Distance(concatenate(list(Rig.load(inputs.rig).surfaces.values()))),
        points=points,
        landmarks=read_landmarks(inputs.landmarks) if inputs.landmarks else None,
    )
    body, extraction = extract_neutral(guesses[name], evidence)
    for figure, (value, unit) in extraction.metrics().items():
        log.info("%s: %.3f %s", figure, value, unit)
    write_bodies(output, {name: body}, inputs.all())
