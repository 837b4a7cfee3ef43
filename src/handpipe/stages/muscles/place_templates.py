"""Templates of muscles and ligaments carried onto the subject's bones (Wang 2021 §6.1)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import Array, InputError, artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import CarriedTemplate
from handpipe.imaging.evidence import read_landmarks
from handpipe.mesh.files import read_surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.muscles.fitting import BoneWarp, place, read_attachments, require_near_bones

log = logging.getLogger(__name__)
EDGE, THIN_EDGE = 1.1, 0.7  # mm, of the meshes of muscles and of ligaments


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    templates: Sequence[Path]
    carried: Path | None = None


def place_templates(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """Templates of muscles and ligaments carried onto the subject's bones (Wang 2021 §6.1)."""
    bones = Rig.load(inputs.rig).surfaces
    templates = {
        name: read_surface(dataset.path(bone.template), closed=True)
        for name, bone in dataset.bones.items()
        if bone.template is not None
    }
    if inputs.carried is None:
        warp: Callable[[Array], Array] = BoneWarp(templates, {name: bones[name] for name in templates})
    else:
        warp = CarriedTemplate.load(inputs.carried).warp()
    data = {}
    for name, organ in {**dataset.muscles, **dataset.ligaments}.items():
        template = read_surface(dataset.path(organ.template), closed=True)
        path = dataset.path(organ.attachments)
        attachments = read_attachments(path, template)
        for bone in attachments:
            if bone not in dataset.bones:
                raise InputError(path, bone, "is not a bone of the dataset", "Attach to one of its bones")
        require_near_bones(dataset.path(organ.template), template, attachments, templates)
        landmarks = read_landmarks(dataset.path(organ.landmarks)) if organ.landmarks else {}
        edge = EDGE if name in dataset.muscles else THIN_EDGE
        guess = place(template, attachments, warp, edge, landmarks, path)
        log.info("%s: %d vertices", name, len(guess.surface.vertices))
        surface = {"vertices": guess.surface.vertices, "triangles": guess.surface.triangles}
        data[name] = {**surface, "attachments": guess.attachments, "landmarks": guess.landmarks}
    units = {f"{name}/vertices": "mm" for name in data}
    artifacts.write(output, data, kind="placed_templates", units=units, inputs=inputs.all())
