"""A part of a hand: chosen bones with the bones that carry them, and the organs that lie wholly on these."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import LAYERS, InputError
from handpipe.core.configuration import Dataset, Muscle, Scene
from handpipe.tissues.muscles.fitting import read_vertex_ids

FINGERS = {"thumb": "1", "index": "2", "middle": "3", "ring": "4", "little": "5"}
ORGANS = ("tendons", "muscles", "ligaments")  # layers whose members lie on bones of their own
FIELD = "only"


@dataclass(frozen=True)
class HandPart:
    """A dataset with fewer bones.

    Parameters
    ----------
    dataset : Dataset
        The bones with the organs that lie wholly on them.
    left_out : mapping of str to mapping of str to tuple of str
        Bones that each omitted organ needs and the part lacks, by kind ("tendons", ...) and organ.
    """

    dataset: Dataset
    left_out: Mapping[str, Mapping[str, tuple[str, ...]]]

    def __str__(self) -> str:
        """Omitted organs with missing bones, e.g. "tendons: flexor2 (capitate), flexor3 (capitate)"."""
        return "; ".join(
            f"{kind}: {', '.join(f'{name} ({_words(bones)})' for name, bones in organs.items())}"
            for kind, organs in self.left_out.items()
        )


def part_of(sources: Mapping[Path, Scene], dataset_file: Path, dataset: Dataset) -> HandPart:
    """The part of a subject that scenes model; all of it unless they say otherwise.

    Parameters
    ----------
    sources : mapping of Path to Scene
        The scenes that are built together, by file.
    dataset_file : Path
        The file of the dataset, for messages.
    dataset : Dataset
        The whole subject.

    Returns
    -------
    HandPart
        The dataset of the scenes' bones, and the organs that it lacks.

    Raises
    ------
    InputError
        For names that are no bones or fingers, scenes of different bones, layers that need all bones, seeds
        that are not drawn, and attachments that are not yet there.
    """
    chosen = {file: bones_of(file, dataset, scene.only) for file, scene in sources.items()}
    _require_one_choice(chosen)
    bones = next(iter(chosen.values()), list(dataset.bones))
    if len(bones) == len(dataset.bones):
        return HandPart(dataset, {})
    for file, scene in sources.items():
        _require_layers(file, scene, dataset)
    needed = {layer for scene in sources.values() for layer in scene.needed}
    for pose, acquired in dataset.poses.items():
        if acquired.seeds is None and acquired.labels is None:
            problem = f"is not given; seeds are proposed from all bones, but the scenes model {_words(bones)}"
            remedy = f"Draw the seeds of these bones in {pose}, or remove `{FIELD}` from the scenes"
            raise InputError(dataset_file, f"poses.{pose}.seeds", problem, remedy)
    return _restricted(dataset, bones, needed)


def bones_of(source: str | Path, dataset: Dataset, only: Sequence[str] | None) -> list[str]:
    """The named bones and fingers with all bones that carry them, up to the root, in the dataset's order."""
    if only is None:
        return list(dataset.bones)
    carrier = {joint.child: joint.parent for joint in dataset.joints.values()}
    found: set[str] = set()
    for name in only:
        for bone in _named(source, dataset, name):
            while bone not in found:
                found.add(bone)
                bone = carrier.get(bone, bone)
    if len(found) == 1 and len(dataset.bones) > 1:
        problem = f"names {found.pop()} alone, the root of the rig: no joint moves"
        raise InputError(source, FIELD, problem, "Name a bone that it carries, too")
    return [bone for bone in dataset.bones if bone in found]


def _named(source: str | Path, dataset: Dataset, name: str) -> list[str]:
    """One bone, or the bones of a finger: those whose names end with its number."""
    if name in dataset.bones:
        return [name]
    number = FINGERS.get(name)
    bones = [bone for bone in dataset.bones if number and re.search(rf"\D{number}$", bone)]
    if not bones:
        problem = f"{name!r} is neither a bone of {dataset.name} nor a finger with bones in it"
        remedy = f"Name fingers ({', '.join(FINGERS)}) or bones ({', '.join(dataset.bones)})"
        raise InputError(source, FIELD, problem, remedy)
    return bones


def _require_one_choice(chosen: Mapping[Path, Sequence[str]]) -> None:
    """Scenes that are built together share the rig, and so the bones."""
    files = list(chosen)
    for file in files[1:]:
        if chosen[file] != chosen[files[0]]:
            problem = f"models {_words(chosen[file])}, but {files[0]} {_words(chosen[files[0]])}"
            remedy = f"Give both the same `{FIELD}`, or build the scenes in two folders"
            raise InputError(file, FIELD, problem, remedy)


def _require_layers(file: Path, scene: Scene, dataset: Dataset) -> None:
    wrong = [layer for layer in scene.layers if LAYERS[layer].role == "outer"]
    if wrong:
        problem = f"{wrong[0]} is made of the skin around all bones, but `{FIELD}` names some of them"
        raise InputError(file, "layers", problem, f"Remove {' and '.join(wrong)}, or `{FIELD}`")
    painted = [fascia for fascia in dataset.regions if fascia in scene.layers]
    if painted:
        problem = f"the regions of {painted[0]} are painted on the fascia of all bones"
        remedy = f"Remove {painted[0]} from the layers, or `regions.{painted[0]}` from the dataset"
        raise InputError(file, "layers", problem, remedy)


def _restricted(dataset: Dataset, bones: Sequence[str], layers: Collection[str]) -> HandPart:
    """The bones with the organs of layers that lie wholly on them, without skin, scans and nails."""
    kept = set(bones)
    missing = {
        kind: {name: tuple(sorted(on - kept)) for name, on in _bones_of_organs(dataset, kind).items()}
        for kind in ORGANS
        if kind in layers
    }
    on_part = {kind: [name for name, gone in organs.items() if not gone] for kind, organs in missing.items()}
    organs = {kind: {name: getattr(dataset, kind)[name] for name in on_part.get(kind, ())} for kind in ORGANS}
    poses = {
        name: pose.model_copy(
            update={
                "scan": None,
                "scribbles": {b: path for b, path in pose.scribbles.items() if b in kept},
                "markers": {m: path for m, path in pose.markers.items() if m in organs["muscles"]},
                "landmarks": {m: path for m, path in pose.landmarks.items() if m in organs["muscles"]},
            }
        )
        for name, pose in dataset.poses.items()
    }
    others = {name: bone.label for name, bone in dataset.bones.items() if name not in kept}
    fields = {name: getattr(dataset, name) for name in Dataset.model_fields} | {
        "poses": poses,
        "bones": {name: dataset.bones[name] for name in bones},
        "other_labels": dataset.other_labels | others,
        "joints": {n: joint for n, joint in dataset.joints.items() if joint.child in kept},
        "nails": {},
        "skin_from_volume": False,
        "regions": {},
        **organs,
    }
    left_out = {kind: {n: gone for n, gone in found.items() if gone} for kind, found in missing.items()}
    return HandPart(
        Dataset.model_validate(fields), {kind: found for kind, found in left_out.items() if found}
    )


def _bones_of_organs(dataset: Dataset, kind: str) -> dict[str, set[str]]:
    """The bones that each tendon, muscle or ligament attaches to or passes."""
    if kind == "tendons":
        return {name: {*tendon.bones} for name, tendon in dataset.tendons.items()}
    organs: Mapping[str, Muscle] = getattr(dataset, kind)
    return {name: attached_bones(dataset, dataset.path(o.attachments)) for name, o in organs.items()}


def attached_bones(dataset: Dataset, path: Path) -> set[str]:
    """Names of the bones of a file of attachments; their vertices are checked when the organ is made."""
    if not path.exists():
        remedy = (
            f"Make it first: snakemake -j2 {dataset.path(Path('templates'))} with a scene without `{FIELD}`"
        )
        raise InputError(
            path, "attachments", "is not made yet, and tells which organs lie on the bones", remedy
        )
    return set(read_vertex_ids(path))


def _words(bones: Sequence[str]) -> str:
    return ", ".join(bones)
