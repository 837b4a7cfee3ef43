"""Fibre directions of a muscle: along a flow from its origins to its insertions that follows its curves.

Abdrashitov 2021, Eq. 17 to 20: `gradient_fibres`. The gradient of a potential is always
normal to the attachments, so that muscles whose fibres leave a sheet of tendon at an angle need
`flow_fibres`: the flow through a material that conducts along the curves' directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.anatomy.templates.curves import PlacedAttachment, PlacedMuscle
from handpipe.anatomy.templates.diffusion import (
    WEIGHT,
    Collocation,
    Factorise,
    spread_from_curves,
    stiffness,
    superlu,
)
from handpipe.core import Array, InputError, IntArray, unit_vectors
from handpipe.mesh.surfaces import closest_on_polyline
from handpipe.mesh.tets import Locator, TetMesh, shape_gradients

ALIGNMENT = 5.0  # alpha of Eq. 17, with both terms weighted by volume
TINY = 1e-9  # of a matrix's mean diagonal, for parts without attachments
STILL = 1e-6  # share of the fastest flow below which there is no flow
LEAKAGE = 0.02  # conductivity across the curves' directions over that along them
FEWEST = 3  # vertices that prevent a rotation of an end


@dataclass(frozen=True, eq=False)
class Fibres:
    """Unit directions (m, 3), the potential (n,) from 0 at origins to 1 at insertions, and both sets."""

    directions: Array
    potential: Array
    origin: IntArray
    insertion: IntArray


def fibres(
    mesh: TetMesh,
    muscle: PlacedMuscle,
    *,
    attached: IntArray | None = None,
    factorise: Factorise = superlu,
    source: str = "fibres",
) -> Fibres:
    """Fibres of a muscle's tets, by the method that its curves' file asks for.

    Parameters
    ----------
    mesh : TetMesh
        The muscle's tets in mm.
    muscle : PlacedMuscle
        Its curves and attachments in mm.
    attached : array (a,), optional
        Indices of the vertices that may be origins and insertions, by default all.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.
    source : str
        The muscle's file and field, for messages.

    Returns
    -------
    Fibres
        Unit directions, potential, and the vertices of both ends.

    Raises
    ------
    InputError
        Where no vertex is within reach of the origins or insertions, or both are the same vertices.
    """
    candidates = np.arange(len(mesh.vertices)) if attached is None else attached
    origin = _ends(mesh, muscle.origins, candidates, source, "origin")
    insertion = _ends(mesh, muscle.insertions, candidates, source, "insertion")
    shared = np.intersect1d(origin, insertion)
    if len(shared) in (len(origin), len(insertion)):
        raise InputError(source, "reach", "origin and insertion are the same place", "Make `reach` smaller")
    origin, insertion = np.setdiff1d(origin, shared), np.setdiff1d(insertion, shared)
    curves = Collocation.sample(muscle.curves, Locator(mesh))
    solve = gradient_fibres if muscle.fibres == "gradient" or len(curves.tets) == 0 else flow_fibres
    directions, potential = solve(mesh, curves, origin, insertion, factorise=factorise)
    # A part of the muscle that is not attached at both ends has no flow.
    still = np.flatnonzero(np.linalg.norm(directions, axis=1) < 0.5)
    directions[still] = _nearest_tangents(mesh.vertices[mesh.tets[still]].mean(axis=1), muscle)
    return Fibres(directions, potential, origin, insertion)


def _nearest_tangents(points: Array, muscle: PlacedMuscle) -> Array:
    """Tangents (n, 3) of a muscle's curves where they are nearest to points (n, 3)."""
    on_curves = np.concatenate([c.points for c in muscle.curves])
    tangent = np.concatenate([c.frames[:, 0] for c in muscle.curves])
    return np.asarray(tangent[cKDTree(on_curves).query(points)[1]])


def _ends(
    mesh: TetMesh, attachments: Sequence[PlacedAttachment], candidates: IntArray, source: str, end: str
) -> IntArray:
    """The candidates at which a muscle is attached at one end.

    They are those within reach of any of the attachments, and at least the nearest of each attachment. Where
    these are too few to prevent a rotation of the end, the candidates up to one edge length beyond the
    nearest are added.
    """
    edge = mesh.edge_length()  # the least gap that the mesh can show
    found, wide = [], []
    for attachment in attachments:
        line = np.concatenate([attachment.points, attachment.points[-1:]])
        distance = closest_on_polyline(mesh.vertices[candidates], line)[3]
        nearest = distance.min()
        if nearest > attachment.reach + edge:
            place = ", ".join(f"{c:.1f}" for c in attachment.points[0])
            problem = f"the muscle ends {nearest:.1f} mm from its {end} at ({place})"
            raise InputError(
                source, end, problem, f"Raise `reach` ({attachment.reach:g} mm) or the tissue there"
            )
        found.append(candidates[distance <= max(attachment.reach, nearest)])
        wide.append(candidates[distance <= nearest + edge])
    ends = np.unique(np.concatenate(found))
    return ends if len(ends) >= FEWEST else np.unique(np.concatenate([ends, *wide]))


def gradient_fibres(
    mesh: TetMesh,
    curves: Collocation,
    origin: IntArray,
    insertion: IntArray,
    *,
    alignment: float = ALIGNMENT,
    factorise: Factorise = superlu,
) -> tuple[Array, Array]:
    """Fibre directions (m, 3) and the potential (n,) whose gradient they follow (Eq. 17 to 20).

    An anisotropic conductivity aligns the gradient with the curves' tangents.
    """
    tensors = np.broadcast_to(np.eye(3), (len(mesh.tets), 3, 3)).copy()
    tangent = curves.frames[:, 0]
    # Where several ways of curves lead through a tet, the last one counts.
    tensors[curves.tets] += alignment * (np.eye(3) - tangent[:, :, None] * tangent[:, None, :])
    potential = _potential(mesh, stiffness(mesh, tensors), origin, insertion, factorise)
    return _directions(_gradient(mesh, potential)), potential


def harmonic_fibres(
    mesh: TetMesh, origin: IntArray, insertion: IntArray, *, factorise: Factorise = superlu
) -> Array:
    """Directions along the flow from origin to insertion, for a muscle without curves.

    Where there is no flow, as in a part that is attached at one end only, they are those of the nearest tets.

    Parameters
    ----------
    mesh : TetMesh
        Tets of the muscle, n vertices in mm.
    origin, insertion : array (k,) of int
        Vertices at which the muscle is attached; no vertex is of both.
    factorise : callable
        Solver of the sparse system.

    Returns
    -------
    array (m, 3)
        Unit directions, one a tet.

    References
    ----------
    Abdrashitov 2021, Eq. 17 to 20, without curves.
    """
    directions = _directions(_gradient(mesh, _potential(mesh, stiffness(mesh), origin, insertion, factorise)))
    middles = mesh.vertices[mesh.tets].mean(axis=1)
    still = np.linalg.norm(directions, axis=1) < 0.5
    directions[still] = directions[~still][cKDTree(middles[~still]).query(middles[still])[1]]
    return directions


def flow_fibres(
    mesh: TetMesh,
    curves: Collocation,
    origin: IntArray,
    insertion: IntArray,
    *,
    leakage: float = LEAKAGE,
    factorise: Factorise = superlu,
) -> tuple[Array, Array]:
    """Directions (m, 3) and potential (n,) of a flow that is led along the curves' tangents.

    The tangents, carried harmonically into the muscle, are the directions of its conductivity, 1 along and
    `leakage` across. The flow neither starts nor ends but at the attachments, and runs along the free
    surface.
    """
    isotropic = stiffness(mesh)
    tangents = spread_from_curves(mesh, curves, curves.frames[:, 0], isotropic, WEIGHT, factorise)
    along = _directions(tangents[mesh.tets].mean(axis=1))
    tensors = leakage * np.eye(3) + (1 - leakage) * along[:, :, None] * along[:, None, :]
    potential = _potential(mesh, stiffness(mesh, tensors), origin, insertion, factorise)
    return _directions(np.einsum("mij,mj->mi", tensors, _gradient(mesh, potential))), potential


def _potential(
    mesh: TetMesh, matrix: sparse.csr_matrix, origin: IntArray, insertion: IntArray, factorise: Factorise
) -> Array:
    """0 at the origin, 1 at the insertion, and the least energy of the matrix between; no flow elsewhere."""
    potential = np.zeros(len(mesh.vertices))
    potential[insertion] = 1.0
    free = np.setdiff1d(np.arange(len(potential)), np.concatenate([origin, insertion]))
    block = matrix[free][:, free].tocsr()
    # In a part without attachments every constant is a solution: take the smallest.
    block = block + TINY * block.diagonal().mean() * sparse.eye(len(free), format="csr")
    potential[free] = factorise(block).solve(-(matrix @ potential)[free])
    return potential


def _gradient(mesh: TetMesh, potential: Array) -> Array:
    return np.einsum("mci,mc->mi", shape_gradients(mesh.vertices, mesh.tets), potential[mesh.tets])


def _directions(vectors: Array) -> Array:
    """Unit vectors, or zero for vectors within rounding errors."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > STILL * length.max(), unit_vectors(vectors), 0.0)
