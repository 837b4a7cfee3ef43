"""What the fat and the single soft tissue share: tetrahedra between an inner surface and the skin."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from handpipe.core import InputError, Shapes
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import smoothed_weights
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import (
    Skin,
    Tissue,
    TissueSettings,
    inner_points,
    skin_share,
    tissue_mesh,
    without_pockets,
)

log = logging.getLogger(__name__)

SKIN_THICKNESS = 1.5  # mm
NOTABLE, WRONG = 0.5, 3.0  # mm that a body lies outside of the skin: named, and refused


@dataclass(frozen=True)
class Inside:
    """What a tissue encloses in neutral.

    below: shapes by layer, of which the named `layers` hold the tissue; surface: the inner surface of the
    tissue, which encloses them; source: the file that the shapes come from.
    """

    below: Mapping[str, Shapes]
    layers: tuple[str, ...]
    surface: Surface
    source: Path


def make_tissue(
    rig: Rig,
    inside: Inside,
    skin: Skin,
    edge: float,
    settings: TissueSettings,
) -> Tissue:
    """A tissue between the inner surface and the neutral skin; edge of the tets in mm."""
    bodies = {layer: inside.below.get(layer, {}) for layer in inside.layers}
    require_inside(bodies, skin, inside.source)
    mesh, occupancy = tissue_mesh(skin.surface, inside.surface, edge)
    points = inner_points(inside.below, inside.layers, inside.surface, slack=0.25)
    mesh, occupancy, points = without_pockets(mesh, occupancy, skin.surface, points)
    log.info("%d vertices, %d tets, %d inner points", len(mesh.vertices), len(mesh.tets), len(points.rest))
    weights = smoothed_weights(mesh, rig.surfaces)
    made = Tissue(mesh, occupancy, skin.surface, points, skin.rigid, tuple(rig.surfaces), weights, settings)
    share = skin_share(mesh, skin.surface, inside.surface, SKIN_THICKNESS)
    return replace(made, skin_share=share, parents=rig.parents)


def require_inside(bodies: Mapping[str, Shapes], skin: Skin, source: Path) -> None:
    """Name bodies, by layer, that lie outside of the neutral skin; `InputError` where one is far outside."""
    for layer, shapes in bodies.items():
        for name, shape in shapes.items():
            if shape.cells.shape[1] != 3:
                continue
            beyond = skin.outside(shape.vertices)
            worst = int(beyond.argmax())
            if beyond[worst] < NOTABLE:
                continue
            place = ", ".join(f"{c:.1f}" for c in shape.vertices[worst])
            problem = f"lies up to {beyond[worst]:.1f} mm outside of the skin, near ({place}) mm in neutral"
            if beyond[worst] > WRONG:
                remedy = "Look at its segmentation or its template, and at the scan there"
                raise InputError(source, f"{layer}: {name}", problem, remedy)
            log.warning("%s: %s %s", layer, name, problem)
