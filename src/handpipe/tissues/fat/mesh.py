"""Tetrahedra between an inner surface and the skin, with how much of each is tissue (Zheng 2022 §7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.mesh.generation import remesh, tetrahedralise, union_surface
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh

SAMPLES = 20  # points a tet, to measure how much of it is tissue
LEAST_OCCUPANCY = 0.1  # a tet of the mesh keeps at least this share of its stiffness
OUTWARDS = 0.1  # of an edge by which the hull is larger than the skin


def tissue_mesh(skin: Surface, inner: Surface, edge: float) -> tuple[TetMesh, Array]:
    """Tets inside the skin and outside of the inner surface, and how much of each is tissue.

    The mesh conforms to neither surface: both are embedded in it, and stiffness is weighted by occupancy.

    Parameters
    ----------
    skin : Surface
        Closed skin in mm.
    inner : Surface
        Closed surface of the inner bodies in mm.
    edge : float
        Edge length in mm.

    Returns
    -------
    mesh : TetMesh
        Vertices in mm, m tets.
    occupancy : array (m,)
        Share of each tet that is tissue, at least 0.1.
    """
    hull = remesh(skin, edge)
    hull = hull.moved(hull.vertices + OUTWARDS * edge * hull.vertex_normals())
    full = tetrahedralise(hull, edge)
    share = occupancy(full, skin, inner)
    depth = Distance(inner).signed(full.vertices)[0]
    keep = (share > 0) & ~(depth[full.tets] < 0).all(axis=1)
    used, tets = np.unique(full.tets[keep], return_inverse=True)
    return TetMesh(full.vertices[used], tets.reshape(-1, 4)), np.maximum(share[keep], LEAST_OCCUPANCY)


def inner_surface(bodies: Sequence[Surface], spacing: float, gap: float) -> Surface:
    """One surface around the inner bodies, with the narrow clefts between them closed.

    Fat in such a cleft would be crushed between bodies that move over one another; the papers wrap them too.

    Parameters
    ----------
    bodies : sequence of Surface
        Surfaces in mm.
    spacing : float
        Grid spacing in mm at which the surface is made.
    gap : float
        Half the width in mm of the widest cleft that is closed.

    Returns
    -------
    Surface
        Closed surface in mm.

    References
    ----------
    Zheng 2022 Fig. 21b.
    """
    grown = union_surface(list(bodies), spacing, offset=gap)
    return union_surface([grown], spacing, offset=-gap)


def occupancy(mesh: TetMesh, skin: Surface, inner: Surface) -> Array:
    """Share (m,) of each tet that lies inside the skin and outside of the inner surface."""
    weights = np.random.default_rng(0).dirichlet(np.ones(4), size=SAMPLES)
    points = np.einsum("sc,mci->msi", weights, mesh.vertices[mesh.tets])
    share = np.empty(len(mesh.tets))
    clear = _far_from(mesh, skin, inner)
    share[clear] = 1.0
    flat = points[~clear].reshape(-1, 3)
    tissue = (Distance(skin).signed(flat)[0] < 0) & (Distance(inner).signed(flat)[0] > 0)
    share[~clear] = tissue.reshape(-1, SAMPLES).mean(axis=1)
    return share


def _far_from(mesh: TetMesh, skin: Surface, inner: Surface) -> BoolArray:
    """Tets (m,) whose circumscribed reach from their centre meets neither surface, and that are tissue."""
    centres = mesh.vertices[mesh.tets].mean(axis=1)
    reach = np.linalg.norm(mesh.vertices[mesh.tets] - centres[:, None], axis=2).max(axis=1)
    return (Distance(skin).signed(centres)[0] < -reach) & (Distance(inner).signed(centres)[0] > reach)
