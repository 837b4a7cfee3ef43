"""The generators of datasets: one record a generator, which rules, checks and stages read."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal, Protocol, cast

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.synthetic.family import PEOPLE


@dataclass(frozen=True)
class GeneratorRecord:
    """What is known of a generator without its code.

    Parameters
    ----------
    truth : {"bones", "tissues", "coupled", "sliding"}, optional
        What is known of its subjects: the bones alone, all tissues, or all tissues by a simulation, of one
        body or of bodies that slide on one another. None where the images are real.
    module : str, optional
        Dotted name of a module as `Generator`. None where several rules make the subject.
    template : {"curves", "surfaces"}, optional
        What the template hand of all organs is made of: `config/anatomy/hand.yaml` or surfaces of real
        anatomy. None where there is no such hand.
    needs : tuple of str
        Fields of the dataset without which nothing can be generated.
    own : tuple of str
        Fields of the dataset that only generators with such an entry may have.
    """

    truth: Literal["bones", "tissues", "coupled", "sliding"] | None
    module: str | None = None
    template: Literal["curves", "surfaces"] | None = None
    needs: tuple[str, ...] = ()
    own: tuple[str, ...] = ()


GENERATORS: dict[str, GeneratorRecord] = {
    "phantom-finger": GeneratorRecord(truth="tissues", module="handpipe.synthetic.phantom.phantom_finger"),
    "phantom-finger-sliding": GeneratorRecord(
        truth="sliding", module="handpipe.synthetic.sliding.finger_subject"
    ),
    "zanatomy-index": GeneratorRecord(
        truth="tissues", module="handpipe.synthetic.real_anatomy.zanatomy_index", needs=("anatomy",)
    ),
    "phantom-hand": GeneratorRecord(
        truth="bones",
        module="handpipe.synthetic.phantom.phantom_hand",
        template="curves",
        own=("scanner",),
    ),
    "phantom-hand-rolling": GeneratorRecord(
        truth="bones", module="handpipe.synthetic.rolling.rolling_hand", own=("scanner",)
    ),
    "phantom-hand-complete": GeneratorRecord(
        truth="coupled", template="curves", own=("scanner", "proportions")
    ),
    "myohand-bones": GeneratorRecord(
        truth="bones",
        module="handpipe.synthetic.real_anatomy.myohand_bones",
        needs=("anatomy",),
        own=("scanner",),
    ),
    "zanatomy-bones": GeneratorRecord(
        truth="bones",
        module="handpipe.synthetic.real_anatomy.zanatomy_bones",
        needs=("anatomy",),
        own=("scanner",),
    ),
    "zanatomy-hand": GeneratorRecord(
        truth="coupled", template="surfaces", needs=("anatomy",), own=("scanner",)
    ),
    "real-limb": GeneratorRecord(truth=None, needs=("anatomy", "limb"), own=("limb",)),
}


class Generator(Protocol):
    """Interface of a generator's module: files of one pose, or of the templates."""

    def generate_pose(self, dataset: Dataset, pose: str) -> None:
        """Write a pose's volume, seeds, scan, truth and label volumes where the dataset names them.

        Raises
        ------
        InputError
            For an unknown pose, or where the source data are absent.
        """

    def generate_templates(self, dataset: Dataset) -> None:
        """Write the templates, attachments, tendon curves and nail patches that the dataset names."""


def record_of(source: str | Path, name: str) -> GeneratorRecord:
    """The record of a generator; `InputError` for an unknown name. source: file that names it."""
    if name not in GENERATORS:
        problem = f"{name!r} is no generator; the generators are {', '.join(GENERATORS)}"
        raise InputError(source, "generator", problem, "See config/README.md")
    return GENERATORS[name]


def require_known(source: str | Path, dataset: Dataset) -> None:
    """Check what a dataset file says of generators.

    Parameters
    ----------
    source : path
        The file of the dataset, for messages.
    dataset : Dataset
        What it says.

    Raises
    ------
    InputError
        For a generator that is not known, a field that it needs and that is not given, a field that
        belongs to other generators, and proportions of nobody who was measured.
    """
    if dataset.proportions is not None and dataset.proportions not in PEOPLE:
        problem = f"{dataset.proportions!r} is no measured person"
        raise InputError(source, "proportions", problem, f"Use one of {', '.join(PEOPLE)}")
    record = None if dataset.generator is None else record_of(source, dataset.generator)
    for field in () if record is None else record.needs:
        if getattr(dataset, field) is None:
            problem = f"is not given, but the generator {dataset.generator} needs it"
            raise InputError(source, field, problem, "See config/README.md")
    for field in dict.fromkeys(field for known in GENERATORS.values() for field in known.own):
        owners = [name for name, known in GENERATORS.items() if field in known.own]
        if getattr(dataset, field) is not None and dataset.generator not in owners:
            problem = f"is only for the generators {', '.join(owners)}"
            raise InputError(source, field, problem, "Remove it, or name one of these generators")


def generator_of(dataset: Dataset) -> Generator:
    """The generator that the dataset names; `InputError` if it names none, or one of several rules."""
    if dataset.generator is None:
        raise InputError(
            dataset.name, "generator", "is not given", "Only generated datasets can be generated"
        )
    module = record_of(dataset.name, dataset.generator).module
    if module is None:
        problem = f"{dataset.generator} is made by several rules of the workflow"
        raise InputError(dataset.name, "generator", problem, "Build the target `data`")
    return cast(Generator, import_module(module))
