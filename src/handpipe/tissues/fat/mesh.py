"""Tetrahedra between an inner surface and the skin, with how much of each is tissue (Zheng 2022 §7)."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from handpipe.core import Array, BoolArray, InputError
from handpipe.mesh.contact import crossings
from handpipe.mesh.generation import remesh, tetrahedralise, union_surface
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh, nearest_tets, tet_neighbours, tet_pieces
from handpipe.tissues.fat.constraints import InnerPoints

log = logging.getLogger(__name__)

SAMPLES = 20  # points a tet, to measure how much of it is tissue
LEAST_OCCUPANCY = 0.1  # a tet of the mesh keeps at least this share of its stiffness
MOST_LOST = 0.01  # of the tissue, in pockets that are left out
BESIDE = 0.2  # of an edge that the skin may be outside of the piece that is kept: its nearest tet carries it
OUTWARDS = 0.1  # of an edge by which the hull is larger than the skin
HALVINGS = 6  # of that, where the hull would cut itself


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
    full = tetrahedralise(_hull(skin, edge), edge)
    share = occupancy(full, skin, inner)
    depth = Distance(inner).signed(full.vertices)[0]
    keep = (share > 0) & ~(depth[full.tets] < 0).all(axis=1)
    return _part(full, keep), np.maximum(share[keep], LEAST_OCCUPANCY)


def _hull(skin: Surface, edge: float) -> Surface:
    """A coarse surface, a little larger than the skin; less where it would cut itself, as between fingers."""
    hull = remesh(skin, edge)
    outwards = OUTWARDS * edge * hull.vertex_normals()
    share = np.ones((len(hull.vertices), 1))
    for _ in range(HALVINGS + 1):
        larger = hull.moved(hull.vertices + share * outwards)
        crossed = crossings(larger)
        if len(crossed) == 0:
            return larger
        edges, triangles = crossed.T
        share[hull.edges()[edges]] *= 0.5
        share[hull.triangles[triangles]] *= 0.5
    where = tuple(np.round(larger.vertices[hull.triangles[triangles[0]]].mean(axis=0), 1).tolist())
    problem = f"cuts itself near {where} mm where its triangles have edges of {edge:g} mm"
    raise InputError("skin", "triangles", problem, "Give a smaller edge for fat, or look at the skin there")


def without_pockets(
    mesh: TetMesh, share: Array, skin: Surface, points: InnerPoints
) -> tuple[TetMesh, Array, InnerPoints]:
    """The largest piece of a tissue that is connected by faces, and the inner points in it.

    Other pieces lie in pockets between inner bodies, or are slivers beneath the skin where fingers meet. They
    share an edge, a vertex or nothing with the tissue, and turn without resistance: the tangent stiffness is
    singular, and Newton directions have any length.

    Parameters
    ----------
    mesh : TetMesh
        Tets in mm, of `tissue_mesh`.
    share : array (m,)
        How much of each is tissue.
    skin : Surface
        Skin in mm, embedded in the mesh.
    points : InnerPoints
        Points of inner bodies, embedded in the mesh.

    Returns
    -------
    mesh : TetMesh
        The piece.
    share : array
        How much of its tets is tissue.
    points : InnerPoints
        Those whose tet belongs to it.

    Raises
    ------
    InputError
        If skin is more than a fifth of an edge outside of the largest piece, or the other pieces are more
        than 1 % of the tissue.
    """
    piece = tet_pieces(len(mesh.tets), tet_neighbours(mesh.tets))
    tissue = share * mesh.volumes()
    volumes = np.bincount(piece, weights=tissue)
    if len(volumes) == 1:
        return mesh, share, points
    keep = piece == volumes.argmax()
    lost = 1 - volumes.max() / volumes.sum()
    kept = _part(mesh, keep)
    off = np.flatnonzero(~keep[nearest_tets(skin.vertices, mesh)])
    border = Surface(kept.vertices, kept.boundary_faces()[0])
    off = off[Distance(border).closest(skin.vertices[off])[0] > BESIDE * mesh.edge_length()]
    if len(off) or lost > MOST_LOST:
        where = np.round(skin.vertices[off[0]] if len(off) else mesh.vertices[mesh.tets[~keep][0, 0]], 1)
        problem = (
            f"tetrahedra are in {len(volumes)} pieces that share no face, {100 * lost:.2g} % of the tissue "
        )
        problem += f"is not in the largest; another piece is near {tuple(where.tolist())} mm"
        raise InputError("config", "edges", problem, "Give a smaller edge for fat, or look at the skin there")
    text = "left out %d tets in pockets, %.2g %% of the tissue (limit %.2g %%)"
    log.info(text, np.count_nonzero(~keep), 100 * lost, 100 * MOST_LOST)
    return kept, share[keep], points.chosen(keep[nearest_tets(points.rest, mesh)])


def _part(mesh: TetMesh, keep: BoolArray) -> TetMesh:
    """Some of the tets of a mesh, and their vertices."""
    used, tets = np.unique(mesh.tets[keep], return_inverse=True)
    return TetMesh(mesh.vertices[used], tets.reshape(-1, 4))


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


def skin_share(mesh: TetMesh, skin: Surface, inner: Surface, thickness: float) -> Array:
    """How much of each tet's tissue is skin.

    Parameters
    ----------
    mesh : TetMesh
        Vertices in mm, m tets.
    skin : Surface
        Closed outer surface in mm.
    inner : Surface
        Closed surface in mm of the inner bodies, which are no tissue.
    thickness : float
        Depth in mm below the outer surface to which tissue is skin.

    Returns
    -------
    array (m,)
        Share from 0 to 1; 0 where a tet has no tissue.
    """
    # Points of their own in every tet: a thin layer may lie between those that all tets have in common.
    weights = np.random.default_rng(0).dirichlet(np.ones(4), size=(len(mesh.tets), SAMPLES))
    points = np.einsum("msc,mci->msi", weights, mesh.vertices[mesh.tets]).reshape(-1, 3)
    depth = -Distance(skin).signed(points)[0]
    tissue = ((depth > 0) & (Distance(inner).signed(points)[0] > 0)).reshape(-1, SAMPLES)
    own = tissue & (depth < thickness).reshape(-1, SAMPLES)
    return own.sum(axis=1) / np.maximum(tissue.sum(axis=1), 1)


def _far_from(mesh: TetMesh, skin: Surface, inner: Surface) -> BoolArray:
    """Tets (m,) whose circumscribed reach from their centre meets neither surface, and that are tissue."""
    centres = mesh.vertices[mesh.tets].mean(axis=1)
    reach = np.linalg.norm(mesh.vertices[mesh.tets] - centres[:, None], axis=2).max(axis=1)
    return (Distance(skin).signed(centres)[0] < -reach) & (Distance(inner).signed(centres)[0] > reach)
