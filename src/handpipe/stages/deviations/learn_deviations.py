"""How far a fitted hand is expected to be off, learned from its own scans and fits, without truth."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Shapes, artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import read_frames
from handpipe.hand.deviations import (
    BodyDeviation,
    ExampleTissue,
    HandDeviations,
    JointDeviation,
    Seen,
    centreline,
    of_muscle,
    of_skin,
    of_tendon,
    scanned_covariances,
)
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.files import read_scan
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones import read_registrations
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.fat import FatStrains, Tissue
from handpipe.tissues.muscles import Muscle
from handpipe.tissues.muscles.separation import load_surfaces
from handpipe.tissues.tendons import CENTRELINE, Tendon

Layers = Mapping[str, Shapes]


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads.

    Parameters
    ----------
    registrations : sequence of path
        Of all poses of the dataset, in its order.
    posed_tendons : sequence of path
        Of the tendons in their order, each in all example poses.
    separated, inner, skins, passive, scans : sequence of path
        Of the example poses.
    """

    rig: Path
    rig_table: Path
    volume: Path
    registrations: Sequence[Path]
    tendons: Sequence[Path]
    posed_tendons: Sequence[Path]
    templates: Path | None
    muscles: Sequence[Path]
    separated: Sequence[Path]
    inner: Sequence[Path]
    fat: Path | None
    strains: Path | None
    skins: Sequence[Path]
    passive: Sequence[Path]
    scans: Sequence[Path]


def learn_deviations(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """How far a fitted hand is expected to be off, learned from its own scans and fits, without truth."""
    rig = Rig.load(inputs.rig)
    rows = {row["joint"]: row for row in json.loads(inputs.rig_table.read_text(encoding="utf-8"))}
    registered = dict(zip(dataset.poses, map(read_registrations, inputs.registrations), strict=True))
    scanned = {
        pose: scanned_covariances(rig, pose, registered[pose], rig.scanned_bones(pose))
        for pose in dataset.poses
        if pose in rig.poses
    }
    joints = tuple(JointDeviation.learned(rig, joint, row) for joint, row in rows.items())
    inner = {pose: read_frames(path)[0][1] for pose, path in zip(dataset.examples, inputs.inner, strict=True)}
    bodies = {**_tendons(inputs, dataset, rig, inner), **_muscles(inputs, dataset, rig, inner)}
    if inputs.fat is not None and inputs.strains is not None:
        fat = Tissue.load(inputs.fat), FatStrains.load(inputs.strains)
        bodies["skin"] = _skin(*fat, inputs, dataset, rig)
    spacing = pose_volume(dataset, dataset.neutral).spacing
    HandDeviations(rig.bones, joints, scanned, bodies, float(max(spacing))).save(output, inputs.all())


def _tendons(
    inputs: Inputs, dataset: Dataset, rig: Rig, inner: Mapping[str, Layers]
) -> dict[str, BodyDeviation]:
    found, posed = {}, iter(inputs.posed_tendons)
    for tendon in map(Tendon.load, inputs.tendons):
        name, fits = f"{tendon.name}{CENTRELINE}", {}
        for pose in dataset.examples:
            x = rig.poses[pose].root.inverse()(artifacts.read(next(posed), "posed_tendon")["x"])
            fits[pose] = Seen(inner[pose]["tendons"][name].vertices, centreline(x))
        found[name] = of_tendon(tendon, fits, rig.surfaces)
    return found


def _muscles(
    inputs: Inputs, dataset: Dataset, rig: Rig, inner: Mapping[str, Layers]
) -> dict[str, BodyDeviation]:
    if inputs.templates is None:
        return {}
    seen = {}
    for pose, path in zip(dataset.examples, inputs.separated, strict=True):
        home = rig.poses[pose].root.inverse()
        seen[pose] = {name: s.moved(home(s.vertices)) for name, s in load_surfaces(path).items()}
    found, templates = {}, artifacts.read(inputs.templates, "placed_templates")
    for muscle in map(Muscle.load, inputs.muscles):
        name = muscle.name
        fits = {p: Seen(inner[p]["muscles"][name].vertices, seen[p][name]) for p in dataset.examples}
        template = Surface(templates[name]["vertices"], templates[name]["triangles"])
        found[name] = of_muscle(muscle, template, fits, rig.surfaces)
    return found


def _skin(tissue: Tissue, strains: FatStrains, inputs: Inputs, dataset: Dataset, rig: Rig) -> BodyDeviation:
    examples, fits = [], {}
    files = zip(dataset.examples, inputs.skins, inputs.passive, inputs.scans, strict=True)
    for pose, path, without_strains, scan in files:
        [(frame, full)] = read_frames(path)
        [(_, passive)] = read_frames(without_strains)
        models = {**full, **passive}
        strained, unstrained = (models[model]["fat_mesh"].vertices for model in ("m0", "m1"))
        examples.append(ExampleTissue(frame.bones, strained, unstrained))
        seen, home = read_scan(scan), rig.poses[pose].root.inverse()
        seen = seen.moved(home(seen.vertices))
        rim = seen.vertices[np.unique(seen.boundary_edges())]
        fits[pose] = Seen(models["m0"]["skin"].vertices, seen, rim)
    return of_skin(tissue, strains, examples, fits, rig.bones)
