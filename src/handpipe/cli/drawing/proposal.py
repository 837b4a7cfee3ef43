"""Strokes of a neutral pose proposed from its volume and the template hand, for a person to look at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from handpipe.cli.drawing.canvas import file_of_strokes, write_strokes
from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.imaging.segmentation import propose_solids
from handpipe.imaging.volumes import Volume, pose_volume
from handpipe.mesh.files import read_surface
from handpipe.skeleton.localisation import Named, TemplateHand, find_solids, name_solids

FINGERS = 3  # at least: fewer do not tell which is which


def propose_strokes(source: Path, dataset: Dataset) -> tuple[Path, dict[str, str | None]]:
    """Write strokes of each neutral bone that is sure, and of the background around them.

    Parameters
    ----------
    source : Path
        Dataset file, for messages.
    dataset : Dataset
        What it says; `poses.{neutral}.seeds` names the file to write.

    Returns
    -------
    target : Path
        The file of the strokes.
    bones : dict of str to (str or None)
        By bone, why it has no stroke; None where it has one.

    Raises
    ------
    InputError
        Where the file of the strokes exists, is not named or of another format; where a bone has no template
        or there are too few fingers; where no bone is sure; and as `pose_volume` and `read_surface` do.
    """
    pose = dataset.neutral
    what = f"poses.{pose}.seeds"
    draw = f"handpipe draw {dataset.name} {pose}"
    target = file_of_strokes(source, dataset, what, dataset.poses[pose].seeds)
    _require_none(target, draw)
    _require_hand(source, dataset, draw)
    volume = pose_volume(dataset, pose)
    image = MarrowEvidence.measure(volume).fine
    found = _named(dataset, image)
    sure = {
        dataset.bones[bone].label: one.solid.voxels
        for bone, one in found.items()
        if one.solid is not None and not one.marked
    }
    if not sure:
        reason = next(iter(found.values())).reason
        problem = f"no bone of {pose} was found for sure: {reason}"
        raise InputError(dataset.path(dataset.poses[pose].volume), "volume", problem, f"Run: {draw}")
    strokes = propose_solids(image, sure, complete=len(sure) == len(found))
    _require_none(target, draw)  # whoever has drawn meanwhile keeps the drawing
    write_strokes(target, strokes, volume, dataset.seed_labels)
    return target, {bone: one.reason if one.marked else None for bone, one in found.items()}


def _named(dataset: Dataset, image: Volume) -> Mapping[str, Named]:
    """What was found of each bone, in the order of the dataset."""
    templates = {
        name: read_surface(dataset.path(bone.template), closed=True)
        for name, bone in dataset.bones.items()
        if bone.template is not None
    }
    found = name_solids(TemplateHand.build(dataset, templates), find_solids(image))
    return {bone: found[bone] for bone in dataset.bones}


def _require_none(target: Path, draw: str) -> None:
    if target.exists():
        raise InputError(target, "strokes", "exist already", f"Delete the file, or run: {draw}")


def _require_hand(source: Path, dataset: Dataset, draw: str) -> None:
    """Raise `InputError` unless every bone has a template and there are fingers enough to tell them apart."""
    bare = [name for name, bone in dataset.bones.items() if bone.template is None]
    if bare:
        problem = f"{', '.join(bare)} have no template to be found by"
        raise InputError(source, "bones", problem, f"Name their templates, or run: {draw}")
    moving = [joint for joint in dataset.joints.values() if joint.angles]
    tips = {joint.child for joint in moving} - {joint.parent for joint in moving}
    if len(tips) < FINGERS:
        problem = f"{len(tips)} fingers are too few to tell one from another"
        raise InputError(source, "joints", problem, f"Run: {draw}")
