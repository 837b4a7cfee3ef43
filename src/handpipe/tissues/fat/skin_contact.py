"""Contact of the skin with itself (Zheng 2022 §7.1)."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.fem.contact import Barrier, CollidingPairs, Contact, Sliding, left_deep
from handpipe.fem.potentials import Potential
from handpipe.mesh.contact import SelfContact, crossings, self_contact
from handpipe.mesh.surfaces import Surface

TOUCH, DEEP = 1.0, 6.0  # mm above and beneath another sheet of the skin within which a vertex has contact
BITE = 1.0  # mm of depth, at most, that one set of planes resolves: deep planes push from where sheets were
DISTANCE = 0.1  # mm within which sheets of skin repel behind a barrier: a fifteenth of the skin's edges
BARRIER_STIFFNESS = 5.0  # times Young's modulus of the tissue
FRICTION = 0.1  # stiffness along sheets that lie on one another, as a share of that across them


def skin_on_skin(
    rest: Surface, skin: Surface, matrix: sparse.csr_matrix, stiffness: Array
) -> list[Potential]:
    """Contact of a skin (v vertices) with itself as it lies now: of two sheets each pushes and is pushed.

    rest: the same in neutral; matrix (v, n) from tissue to skin vertices; stiffness (v,) in mN/mm. Sheets
    that touch stick to one another weakly until planes are renewed: a vertex that slides farther meets other
    facets, and would come back at the renewal.
    """
    found = self_contact(skin, rest, TOUCH, DEEP)
    if len(found.vertices) == 0:
        return []
    apart, stiff = matrix[found.vertices] - found.feet @ matrix, stiffness[found.vertices]
    left = left_deep(found.gaps, found.normals, BITE)
    return [Contact(apart, left, found.normals, stiff), *_sticking(found, apart, skin, stiff)]


def _sticking(
    found: SelfContact, apart: sparse.csr_matrix, skin: Surface, stiffness: Array
) -> list[Potential]:
    touching = found.gaps < 0
    offsets = (skin.vertices[found.vertices] - found.feet @ skin.vertices)[touching]
    along = np.linalg.svd(found.normals[touching, None])[2][:, 1:]
    stiff = FRICTION * stiffness[touching]
    return [Sliding(apart[touching], offsets, tangent, stiff) for tangent in np.moveaxis(along, 1, 0)]


def overlap(rest: Surface, skin: Surface) -> float:
    """Depth in mm, at most, of a skin in itself.

    Where no edge crosses a triangle it is zero, although sheets of a tight fold may face one another as if
    one lay in the other.
    """
    if not len(crossings(skin)):
        return 0.0
    return max(0.0, -float(self_contact(skin, rest, 0.0, DEEP).gaps.min(initial=0.0)))


def skin_barrier(rest: Array, triangles: IntArray, matrix: sparse.csr_matrix, stiffness: float) -> Barrier:
    """The barrier of a skin against itself, of tissue that is at `rest` (n, 3) in neutral; stiffness in kPa.

    It raises `InputError` where the neutral skin intersects itself.
    """
    return Barrier(matrix, triangles, rest, DISTANCE, stiffness, pairs=CollidingPairs(rest=rest))
