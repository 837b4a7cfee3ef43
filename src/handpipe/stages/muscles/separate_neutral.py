"""Neutral muscles without interpenetration, meshed anew: the bodies that all poses deform."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from handpipe.core import InputError
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_bodies, write_bodies
from handpipe.tissues.muscles.fitting import SoftBody
from handpipe.tissues.muscles.separation import NO_VOLUME, drop_contested, separate

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    muscles: Sequence[Path]


def separate_neutral(inputs: Inputs, output: Path, edge: float) -> None:
    """Neutral muscles without interpenetration, meshed anew: the bodies that all poses deform."""
    fitted = drop_contested({n: b for path in inputs.muscles for n, b in read_bodies(path).items()})
    bones = Rig.load(inputs.rig).surfaces
    attached = {n: b.attached_vertices for n, b in fitted.items()}
    # Hidden parts have the volumes of the template: keeping these would displace the visible parts.
    surfaces = {n: b.surface for n, b in fitted.items()}
    visible = {n: b.visible for n, b in fitted.items()}
    found = separate(surfaces, bones, NO_VOLUME, attached=attached, visible=visible)
    log.info("penetration %.3f mm before, %.3f mm after", found.penetration_before, found.penetration)

    def meshed(name: str, guess: SoftBody) -> SoftBody:
        try:
            body = SoftBody.fill(found.surfaces[name], guess.attachments, edge)
        except InputError as error:
            remedy = f"Look at its template and its markers: {name} may be too thin, or folded"
            raise InputError(name, error.field, error.problem, remedy) from error
        return replace(body, visible=guess.visible, landmarks=guess.landmarks)

    bodies = {name: meshed(name, guess) for name, guess in fitted.items()}
    write_bodies(output, bodies, inputs.all())
