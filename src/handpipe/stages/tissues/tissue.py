"""What the fat and the single soft tissue share: tetrahedra between an inner surface and the skin."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

from handpipe.core import Shapes
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import smoothed_weights
from handpipe.tissues.fat import Skin, Tissue, TissueSettings, inner_points, tissue_mesh, without_pockets

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inside:
    """What a tissue encloses in neutral.

    below: shapes by layer, of which the named `layers` hold the tissue; surface: the inner surface of the
    tissue, which encloses them.
    """

    below: Mapping[str, Shapes]
    layers: tuple[str, ...]
    surface: Surface


def make_tissue(
    bones: Mapping[str, Surface], inside: Inside, skin: Skin, edge: float, young: float
) -> Tissue:
    """A tissue between the inner surface and the neutral skin; edge of the tets in mm, young in kPa."""
    mesh, occupancy = tissue_mesh(skin.surface, inside.surface, edge)
    points = inner_points(inside.below, inside.layers, inside.surface, slack=0.25)
    mesh, occupancy, points = without_pockets(mesh, occupancy, skin.surface, points)
    log.info("%d vertices, %d tets, %d inner points", len(mesh.vertices), len(mesh.tets), len(points.rest))
    weights = smoothed_weights(mesh, bones)
    settings = TissueSettings(young=young)
    return Tissue(mesh, occupancy, skin.surface, points, skin.rigid, tuple(bones), weights, settings)
