"""A template of fewer tets that carries the vertices of the template, where details do not matter."""

from __future__ import annotations

import logging

import scipy.sparse as sp

from handpipe.core import HandpipeError
from handpipe.mesh.generation import remesh, tetrahedralise
from handpipe.mesh.tets import Embedding, TetMesh
from handpipe.shapes.organs.remeshing import LOST, PACKED

log = logging.getLogger(__name__)

TETS = 4000  # about as many
WORTH = 2.0  # times as many, from which meshing pays


def coarsened(template: TetMesh) -> tuple[TetMesh, sp.csr_matrix]:
    """About `TETS` tets of the same body, and the map (n0, n) of their vertices to the template's.

    The template itself where it has few tets already, or where so few would lose parts of it.
    """
    itself = template, sp.identity(len(template.vertices), format="csr")
    if len(template.tets) < WORTH * TETS:
        return itself
    volume = float(template.volumes().sum())
    edge = (PACKED * volume / TETS) ** (1 / 3)
    try:
        mesh = tetrahedralise(remesh(template.boundary().compact(), edge), edge)
    except HandpipeError as error:
        log.info("the template keeps its tets: %s", error)
        return itself
    if abs(float(mesh.volumes().sum()) - volume) > LOST * volume:
        log.info("the template keeps its tets: fewer would lose parts of it")
        return itself
    return mesh, Embedding.embed(template.vertices, mesh).matrix(len(mesh.vertices))
