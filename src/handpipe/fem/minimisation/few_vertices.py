"""Which few vertices a Newton step is about, where all others hardly move.

A point that slides over facets, or a contact that opens and closes, meets jumps of the stiffness. The step is
wrong there, and the line search shortens it for all vertices. The energy is minimised over such vertices
first, with all others fixed, which costs little.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray
from handpipe.fem.minimisation.balance import lengths

FAR = 0.1  # of the longest step: vertices with longer ones are those the step is about
FEW = 0.01  # of all vertices, at most


def few_vertices(direction: Array, stiffness: sp.csr_matrix) -> BoolArray | None:
    """The vertices that a step is about, and their neighbours; None where it is about many.

    Parameters
    ----------
    direction : array (3n,)
        Newton step in mm.
    stiffness : sparse matrix (3n, 3n)
        Hessian, whose entries tell neighbours.

    Returns
    -------
    boolean array (n,) or None
        Mask of the vertices.
    """
    steps = lengths(direction)
    about = steps > FAR * steps.max(initial=0.0)
    if not 0 < np.count_nonzero(about) <= FEW * len(steps):
        return None
    return with_neighbours(about, stiffness)


def with_neighbours(chosen: BoolArray, stiffness: sp.csr_matrix) -> BoolArray:
    """A mask (n,) of vertices and of all that share an entry of the Hessian (3n, 3n) with one of them."""
    rows = stiffness[3 * np.flatnonzero(chosen)]
    found = chosen.copy()
    found[rows.indices // 3] = True
    return found
