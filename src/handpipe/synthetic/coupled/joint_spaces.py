"""Joints that open: where bones glide past one another, tissue is attached to neither."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from handpipe.core import BoolArray, IntArray
from handpipe.mesh.tets import tet_neighbours
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy


def opened(anatomy: CoupledAnatomy, passed: BoolArray) -> CoupledAnatomy:
    """The anatomy without tets between two bones, and without attachment at the vertices `passed` (n,).

    Parts that are then connected only by an edge or a vertex are left out, too.
    """
    mesh, owner = anatomy.mesh, np.full(len(anatomy.mesh.vertices), -1)
    for number, on in enumerate(anatomy.bones.values()):
        owner[on] = number
    of_tets = owner[mesh.tets]
    lowest = np.where(of_tets < 0, len(anatomy.bones), of_tets).min(axis=1)
    between = (of_tets.max(axis=1) >= 0) & (of_tets.max(axis=1) != lowest)
    kept = np.flatnonzero(~between)
    kept = kept[_largest_part(mesh.tets[kept])]
    bones = {name: on[~passed[on]] for name, on in anatomy.bones.items()}
    return replace(anatomy, bones=bones).part(kept)[0]


def _largest_part(tets: IntArray) -> IntArray:
    """Tets (k,) of the largest part that faces connect."""
    i, j = tet_neighbours(tets).T
    links = sp.csr_matrix((np.ones(len(i)), (i, j)), shape=(len(tets), len(tets)))
    part = connected_components(links, directed=False)[1]
    return np.flatnonzero(part == np.bincount(part).argmax())
