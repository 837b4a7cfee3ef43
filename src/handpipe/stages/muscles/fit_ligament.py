"""A ligament: its placed template as an elastic body on its bones (Zheng 2022 §4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_guesses
from handpipe.tissues.ligaments import fitting


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    templates: Path


def fit_ligament(inputs: Inputs, output: Path, dataset: Dataset, name: str) -> None:
    """A ligament: its placed template as an elastic body on its bones (Zheng 2022 §4.1)."""
    rig = Rig.load(inputs.rig)
    [guess] = read_guesses(inputs.templates, [name]).values()
    ligament = fitting.fit_ligament(name, guess, rig.parents, dataset.neutral)
    ligament.save(output, inputs.all())
