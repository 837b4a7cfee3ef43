"""What the fat and the single soft tissue share: tetrahedra between an inner surface and the skin."""

import logging

from handpipe.fat.constraints import inner_points
from handpipe.fat.mesh import tissue_mesh
from handpipe.fat.tissue import Tissue, TissueSettings
from handpipe.skeleton.skinning import smoothed_weights

LOG = logging.getLogger(__name__)


def make_tissue(bones, below, layers, inner, young, skin, edge):
    """A tissue between the inner surface and the neutral skin; edge of the tets in mm."""
    mesh, occupancy = tissue_mesh(skin.surface, inner, edge)
    points = inner_points(below, layers, inner, slack=0.25)
    LOG.info("%d vertices, %d tets, %d inner points", len(mesh.vertices), len(mesh.tets), len(points.rest))
    weights = smoothed_weights(mesh, bones)
    settings = TissueSettings(young=young)
    return Tissue(mesh, occupancy, skin.surface, points, skin.rigid, tuple(bones), weights, settings)
