"""What the fat and the single soft tissue share: the skin and its rigid parts."""

import numpy as np

from handpipe.fat.constraints import cut_end, inner_points
from handpipe.fat.mesh import closed_skin, tissue_mesh
from handpipe.fat.nails import nail_vertices
from handpipe.fat.tissue import Rigid, Tissue, TissueSettings
from handpipe.mesh.surface import read_surface
from handpipe.skeleton.skinning import smoothed_weights


def make_tissue(dataset, bones, below, layers, inner, young, scan, edges, log):
    """A tissue between the inner surface and the neutral scan's skin; edges of skin and tets in mm."""
    scan = read_surface(scan)
    skin, notes = closed_skin(scan, edges["skin"])
    for note in notes:
        log.info("neutral scan: %s", note)
    mesh, occupancy = tissue_mesh(skin, inner, edges["fat"])
    points = inner_points(below, layers, inner, slack=0.25)
    rigid = {
        name: Rigid(nail.bone, nail_vertices(skin, read_surface(dataset.path(nail.surface)), tolerance=0.4))
        for name, nail in dataset.nails.items()
    }
    rigid["cut_end"] = Rigid(dataset.root_bone, np.flatnonzero(cut_end(skin, scan, tolerance=1.0)))
    rigid = {name: part for name, part in rigid.items() if len(part.vertices)}
    log.info("%d vertices, %d tets, %d inner points", len(mesh.vertices), len(mesh.tets), len(points.rest))
    weights = smoothed_weights(mesh, bones)
    return Tissue(mesh, occupancy, skin, points, rigid, tuple(bones), weights, TissueSettings(young=young))
