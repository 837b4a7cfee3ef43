"""Tets between bones and skin that conform to both, small where the skin folds (Wang 2019 §5.1-5.3)."""

from __future__ import annotations

import logging

import numpy as np

from handpipe.core import BoolArray
from handpipe.mesh.generation import remesh_graded, tetrahedralise
from handpipe.mesh.surfaces import Distance, Surface, concatenate
from handpipe.mesh.tets import TetMesh

log = logging.getLogger(__name__)

THINNEST = 0.5  # mm of tissue over a bone


def graded_mesh(
    skin: Surface, folding: BoolArray, inner: Surface, fine: float, coarse: float, deep: float
) -> tuple[TetMesh, Surface]:
    """Tets between an inner surface and the skin, whose boundary both surfaces are.

    Parameters
    ----------
    skin : Surface
        Closed neutral skin in mm, n vertices.
    folding : array (n,) of bool
        Vertices where it folds.
    inner : Surface
        Closed surface of the bones and their joint spaces in mm.
    fine, coarse : float
        Edge lengths in mm of the skin where it folds and elsewhere.
    deep : float
        Edge length in mm far from both surfaces.

    Returns
    -------
    mesh : TetMesh
        Vertices in mm; those of the outer surface come first.
    outer : Surface
        The skin as it was remeshed.

    Raises
    ------
    InputError
        Where the surfaces cut one another or themselves.
    """
    outer = remesh_graded(skin, folding, fine, coarse)
    hole = _beneath(inner, outer)
    mesh = tetrahedralise(concatenate([outer, hole.flipped()]), deep)
    log.info("%d triangles of the skin, %d of the bones", len(outer.triangles), len(hole.triangles))
    return mesh, outer


def _beneath(inner: Surface, outer: Surface) -> Surface:
    """The inner surface, pressed in where less than 0.5 mm of tissue would be over it."""
    signed, _, closest, normals = Distance(outer).signed(inner.vertices)
    near = signed > -THINNEST
    if not near.any():
        return inner
    log.warning(
        "bones come within %.1f mm of the skin at %d places; the tissue is %.1f mm thick there",
        -signed.max(),
        np.count_nonzero(near),
        THINNEST,
    )
    vertices = inner.vertices.copy()
    vertices[near] = closest[near] - THINNEST * normals[near]
    return inner.moved(vertices)
