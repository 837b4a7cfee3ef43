"""Plastic strains of a muscle, smooth in space and over poses (Zheng 2022 §4.4, stage 3, Eq. 3)."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import each_moved
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_bodies
from handpipe.stages.poses import flesh_in_poses
from handpipe.tissues.muscles import Examples, Muscle, SeparatedShape
from handpipe.tissues.muscles.separation import load_surfaces

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    neutral: Path
    shapes: Path
    separated: Sequence[Path]  # none: muscles as stage 1 found them
    flesh: Sequence[Path]


def fit_muscle_strains(inputs: Inputs, output: Path, dataset: Dataset, name: str) -> None:
    """Plastic strains of a muscle, smooth in space and over poses (Zheng 2022 §4.4, stage 3, Eq. 3)."""
    rig = Rig.load(inputs.rig)
    bodies = read_bodies(inputs.neutral)
    shapes = artifacts.read(inputs.shapes, "muscle_shapes")
    if inputs.separated:
        surfaces = dict(zip(dataset.examples, map(load_surfaces, inputs.separated), strict=True))
    else:
        surfaces = {
            pose: {n: b.surface.moved(shapes[pose][n]["vertices"]) for n, b in bodies.items()}
            for pose in dataset.examples
        }
    # Surfaces come from each scanner's frame to the rig's, in which the muscle will be simulated.
    back = {pose: rig.poses[pose].root.inverse() for pose in dataset.examples}
    transforms = {pose: rig.scanned_bones(pose) for pose in dataset.examples}
    separated_shapes = {}
    for pose in dataset.examples:
        separated = {n: s.moved(back[pose](s.vertices)) for n, s in surfaces[pose].items()}
        own = separated.pop(name)
        start = back[pose](shapes[pose][name]["mesh_vertices"])
        known = {bone: s for bone, s in rig.surfaces.items() if bone in transforms[pose]}
        bones = each_moved(known, transforms[pose])
        separated_shapes[pose] = SeparatedShape(own, start, [*separated.values(), *bones.values()])
    flesh = flesh_in_poses(inputs.flesh)
    examples = Examples(rig.parents, dataset.neutral, transforms, dataset.muscle_interpolation, flesh)
    muscle, fit = Muscle.fit(name, bodies[name], examples, separated_shapes)
    log.info(
        "gamma %.3g, eigenvalues %.2f to %.2f, %.3f mm",
        fit.gamma,
        *fit.eigenvalues,
        fit.distances.max(initial=0.0),
    )
    muscle.save(output, inputs.all())
