"""Hooks of a tendon: skinning weights and corrections of poses from registered rods (Zheng 2022 §5.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import RigidTransform, artifacts
from handpipe.core.configuration import Dataset
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.poses import flesh_in_poses
from handpipe.tissues.tendons import RegisteredRods, build_tendon
from handpipe.tissues.tendons.rods import RestTendon


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    neutral: Path
    poses: Sequence[Path]
    flesh: Sequence[Path]


def fit_hooks(inputs: Inputs, output: Path, dataset: Dataset, name: str) -> None:
    """Hooks of a tendon: skinning weights and corrections of poses from registered rods (Zheng 2022 §5.4)."""
    rig = Rig.load(inputs.rig)
    neutral = artifacts.read(inputs.neutral, "neutral_tendon")
    bones = {b: rig.surfaces[b] for b in dataset.tendons[name].bones}
    rest = RestTendon.build(neutral["x"], neutral["radii"], bones)
    # The hooks are driven by the rig, as in the simulation; rods come from the scanner's frame to the rig's.
    rods = {dataset.neutral: rest.x}
    poses = {dataset.neutral: dict.fromkeys(bones, RigidTransform.identity())}
    for pose, path in zip(dataset.examples, inputs.poses, strict=True):
        rods[pose] = rig.poses[pose].root.inverse()(artifacts.read(path, "posed_tendon")["x"])
        moved = rig.scanned_bones(pose)
        poses[pose] = {b: moved[b] for b in bones}
    flesh = flesh_in_poses(inputs.flesh)
    radius = float(neutral["radii"].mean())
    examples = RegisteredRods(rods, poses, rig.parents, flesh or None)
    tendon = build_tendon(name, rest, radius, bones, examples)
    tendon.save(output, inputs.all())
