"""Labels of a pose without conflicts between bones, and the bones' surfaces."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.hand import labelled_bones
from handpipe.imaging.bone_surfaces import blurred_shells, marrow_surface, outline_surface, whole_bone
from handpipe.imaging.learned import learned_appearances, learned_doubts
from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, claims, merge
from handpipe.imaging.volumes import pose_volume, rasterise, read_labels, write_labels
from handpipe.skeleton.bones import write_surfaces
from handpipe.skeleton.registration import neutral_doubts
from handpipe.stages.files import Files
from handpipe.stages.images.known_seeds import known_seeds

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    seeds: Path | None
    bones: Path
    corrected: Sequence[Path]
    scribbles: Sequence[Path]
    neutral: Path | None
    labels: Path | None = None


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    labels: Path
    table: Path
    surfaces: Path
    looks: Path


def merge_labels(inputs: Inputs, outputs: Outputs, dataset: Dataset, pose: str) -> None:
    """Labels of a pose without conflicts between bones, and the bones' surfaces."""
    volume = pose_volume(dataset, pose)
    table = dataset.labels
    labelled = labelled_bones(inputs.labels, dataset, pose, volume)
    shown = {dataset.poses[pose].labels_show: labelled} if labelled else {}
    seeds = known_seeds(inputs.seeds, volume, dataset, labelled)
    corrected = dataset.poses[pose].scribbles
    for name, path in zip(corrected, inputs.scribbles, strict=True):
        scribbles = read_labels(path, volume, dataset.seed_labels)
        seeds = add_scribbles(seeds, scribbles, dataset.bones[name].label)
    answered = {*corrected, *labelled}  # by a person: doubts are logged alone
    names = {label: name for name, label in table.items()}

    found = claims.load(inputs.bones, inputs.corrected)
    _, merged = merge(
        volume, {table[name]: bone for name, bone in found.items()}, seeds, SegmentationSettings()
    )
    bones = {names[label]: bone for label, bone in merged.items()}
    learned = dataset.contrast == "learned"
    looks = (learned_appearances if learned else claims.appearances)(volume, bones)
    neutral = claims.read_looks(inputs.neutral)[0] if inputs.neutral else {}
    left_out = {name: "it has no seeds in its marrow" for name in table if name not in bones}
    left_out |= claims.doubted(looks, neutral, answered)
    if learned:
        left_out |= learned_doubts(bones, corrected)
    surface = outline_surface if learned else marrow_surface  # a learned bone holds its cortex
    marrows = {
        name: shown.get("marrow", {}).get(name) or surface(volume, b)
        for name, b in bones.items()
        if name not in left_out
    }
    if pose == dataset.neutral:
        cut = {name for name, look in looks.items() if look.cut_off}
        for name, reason in neutral_doubts(marrows, dataset.joints, cut).items():
            log.warning("%s: doubted, since %s", name, reason)
            if name not in answered:
                left_out[name] = reason
    if left_out and pose == dataset.neutral:
        problem = "; ".join(f"{name}: {reason}" for name, reason in left_out.items())
        remedy = f"Mend its strokes, or name a label volume of more under poses.{pose}.scribbles"
        raise InputError(inputs.seeds or f"poses.{pose}", "seeds", problem, remedy)
    for name, reason in left_out.items():
        log.warning("%s is left out: %s", name, reason)
    bones = {name: bone for name, bone in bones.items() if name not in left_out}

    surfaces = {name: {"marrow": marrow} for name, marrow in marrows.items()}
    if pose == dataset.neutral:
        for name, marrow in marrows.items():
            others = [marrows[other] for other in marrows if other != name]
            drawn = marrow if learned else shown.get("whole", {}).get(name)
            surfaces[name]["whole"] = drawn or whole_bone(volume, bones[name], marrow, others)
        if not learned:
            wholes = {name: parts["whole"] for name, parts in surfaces.items()}
            for name, reason in blurred_shells(volume, marrows, wholes).items():
                log.warning("%s: %s", name, reason)
    for name, parts in surfaces.items():
        log.info("%s: marrow of %.0f mm^3", name, parts["marrow"].volume())
    outermost = {table[name]: parts.get("whole", parts["marrow"]) for name, parts in surfaces.items()}
    write_labels(outputs.labels, rasterise(volume, outermost), volume.affine, table)
    claims.write_looks(outputs.looks, looks, left_out)
    write_surfaces(outputs.surfaces, surfaces, inputs.all())
