"""The layers of the simulation, inside out: one record a layer, which everything else reads.

A new layer is a record here and a function that loads it. The records are data, below all packages; the
functions are named as text, so that nothing here imports them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from handpipe.core import paths

Colour = tuple[float, float, float]
MEMBER = "{member}"


def _below(pattern: str, member: str = "") -> str:
    """The pattern of a file below the subject's folder; the wildcard `member` stands for any member."""
    return pattern.removeprefix(f"{paths.SUBJECT}/").replace(f"{{{member}}}", MEMBER)


@dataclass(frozen=True)
class Look:
    """How a layer looks in pictures.

    Parameters
    ----------
    colour : tuple of three float
        sRGB, each from 0 to 1.
    opacity : float
        From 0 to 1; below 1 the layers beneath are visible.
    """

    colour: Colour
    opacity: float = 1.0


@dataclass(frozen=True)
class LayerRecord:
    """What is known of a layer without its code.

    Parameters
    ----------
    needs : tuple of str
        Layers whose shapes its `solve` reads.
    load : str
        "module:function". The function takes the paths of the artifacts and the bones' neutral surfaces by
        name, and returns a `handpipe.core.Layer`.
    artifacts : tuple of str
        Paths below the subject's folder of results; "{member}" stands for the name of each member.
    members : str, optional
        Field of the dataset with the members by name; a subject without one lacks the layer.
    condition : str, optional
        Field of the dataset that tells whether the subject has the layer.
    instead : str, optional
        A layer that provides this one's shapes, too: beside it this one is not made.
    look : Look, optional
        How it looks; none for a layer that nothing shows.
    role : {"inner", "outer", "aid"}
        Under the fat, the fat or skin itself, or no organ: no scene asks for an aid and no output shows it.
    """

    needs: tuple[str, ...]
    load: str
    artifacts: tuple[str, ...]
    members: str | None = None
    condition: str | None = None
    instead: str | None = None
    look: Look | None = None
    role: Literal["inner", "outer", "aid"] = "inner"

    @property
    def module(self) -> str:
        """Dotted name of the module that loads the layer."""
        return self.load.partition(":")[0]

    @property
    def fields(self) -> tuple[str, ...]:
        """Fields of the dataset that tell what the subject has of it.

        They are written as `handpipe.core.configuration.selection` takes them.
        """
        names = () if self.members is None else (f"{self.members}.names",)
        return names if self.condition is None else (*names, self.condition)

    def is_in(self, dataset: Any) -> bool:
        """Whether a subject has the layer. Reads only `fields` of the dataset."""
        given = [name for name in (self.members, self.condition) if name is not None]
        return all(getattr(dataset, name) for name in given)

    def files(self, dataset: Any) -> list[str]:
        """Its artifacts below the subject's folder, member by member."""
        names = [""] if self.members is None else list(getattr(dataset, self.members))
        found = [path.replace(MEMBER, name) for name in names for path in self.artifacts]
        return list(dict.fromkeys(found))


LAYERS: dict[str, LayerRecord] = {
    "bones": LayerRecord(
        needs=(),
        load="handpipe.skeleton.posing.layer:load",
        artifacts=(_below(paths.RIG),),
        look=Look((0.93, 0.89, 0.77)),
    ),
    "bone_fascia": LayerRecord(
        needs=("bones",),
        load="handpipe.tissues.fascia.layer:load_bone_fascia",
        artifacts=(_below(paths.BONE_FASCIA),),
        look=Look((0.62, 0.76, 0.88), opacity=0.35),
    ),
    "flesh": LayerRecord(
        needs=("bones",),
        load="handpipe.tissues.fat.flesh:load",
        artifacts=(_below(paths.FLESH),),
        condition="fleshed",
        role="aid",
    ),
    "tendons": LayerRecord(
        needs=("bones", "flesh"),
        load="handpipe.tissues.tendons.layer:load",
        artifacts=(_below(paths.HOOKS, "tendon"),),
        members="tendons",
        look=Look((0.55, 0.72, 0.93)),
    ),
    "muscles": LayerRecord(
        needs=("bones", "flesh"),
        load="handpipe.tissues.muscles.layer:load",
        artifacts=(_below(paths.MUSCLE_STRAINS, "muscle"),),
        members="muscles",
        look=Look((0.78, 0.27, 0.25)),
    ),
    "muscle_fascia": LayerRecord(
        needs=("bones", "muscles"),
        load="handpipe.tissues.fascia.layer:load_muscle_fascia",
        artifacts=(_below(paths.MUSCLE_FASCIA),),
        members="muscles",
        look=Look((0.86, 0.62, 0.66), opacity=0.35),
    ),
    "ligaments": LayerRecord(
        needs=("bones",),
        load="handpipe.tissues.ligaments.layer:load",
        artifacts=(_below(paths.LIGAMENT, "ligament"),),
        members="ligaments",
        look=Look((0.45, 0.70, 0.52)),
    ),
    "fat": LayerRecord(
        needs=("bones", "bone_fascia", "tendons", "muscle_fascia", "ligaments"),
        load="handpipe.tissues.fat.layer:load_fat",
        artifacts=(_below(paths.FAT), _below(paths.FAT_STRAINS)),
        look=Look((0.96, 0.80, 0.42), opacity=0.3),
        role="outer",
    ),
    "skin": LayerRecord(
        needs=("bones",),
        load="handpipe.tissues.fat.creases.layer:load_skin",
        artifacts=(_below(paths.SOFT_TISSUE),),
        instead="fat",
        look=Look((0.91, 0.71, 0.60), opacity=0.3),
        role="outer",
    ),
}


def organs() -> list[str]:
    """The layers that a scene may ask for.

    Returns
    -------
    list of str
        Names, inside out.
    """
    return [name for name, record in LAYERS.items() if record.role != "aid"]


def inner_layers() -> list[str]:
    """The layers under the fat that outputs show.

    Returns
    -------
    list of str
        Names, inside out.
    """
    return [name for name, record in LAYERS.items() if record.role == "inner"]


def under_fat() -> tuple[str, ...]:
    """The layers whose bodies are the inner surface of the fat.

    Returns
    -------
    tuple of str
        Names, inside out.
    """
    return tuple(name for name in LAYERS["fat"].needs if name != "bones")


def needed(layers: Iterable[str]) -> list[str]:
    """The layers and all layers that they need, directly or through others.

    Parameters
    ----------
    layers : iterable of str
        Names of layers.

    Returns
    -------
    list of str
        Names, inside out, each once.
    """
    found: set[str] = set()
    pending = list(layers)
    while pending:
        layer = pending.pop()
        found.add(layer)
        pending.extend(n for n in LAYERS[layer].needs if n not in found)
    return [layer for layer in LAYERS if layer in found]


def made(layers: Iterable[str], dataset: Any) -> list[str]:
    """The layers that are made of a subject.

    A layer that the subject lacks is left out, as is one whose shapes another one of the layers provides.

    Parameters
    ----------
    layers : iterable of str
        Names of layers.
    dataset : Dataset
        The subject's dataset, or a selection that has the fields of the layers.

    Returns
    -------
    list of str
        Names in the order given.
    """
    given = list(layers)
    records = {name: LAYERS[name] for name in given}
    return [name for name, r in records.items() if r.is_in(dataset) and r.instead not in given]


def artifacts_of(layers: Iterable[str], dataset: Any) -> list[str]:
    """The artifacts that a simulation of the layers reads.

    Parameters
    ----------
    layers : iterable of str
        Names of layers.
    dataset : Dataset
        The subject's dataset, or a selection that has the fields of the layers.

    Returns
    -------
    list of str
        Paths below the subject's folder of results.
    """
    return [path for name in made(layers, dataset) for path in LAYERS[name].files(dataset)]


def looks() -> Mapping[str, Look]:
    """How layers look.

    Returns
    -------
    mapping of str to Look
        Looks by the name of the layer, inside out; layers that nothing shows are missing.
    """
    return {name: record.look for name, record in LAYERS.items() if record.look is not None}
