"""The outer surface and the bones' surfaces of a body's mesh."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, InputError, IntArray
from handpipe.mesh.surfaces import Distance, Surface, barycentric_weights, component_labels
from handpipe.mesh.tets import TetMesh

REACH = 2.0  # mm from a bone within which a strand's end is taken to be on it


def bone_faces(mesh: TetMesh, bone: IntArray) -> IntArray:
    """The mesh's boundary faces (k, 3) on a bone, given the vertices on it."""
    faces = mesh.boundary_faces()[0]
    return faces[np.isin(faces, bone).all(axis=1)]


def outer_faces(mesh: TetMesh, bones: Iterable[IntArray]) -> IntArray:
    """The outermost of the boundary's parts (k, 3) that lie on no bone, given each bone's vertices.

    Cavities within the body, as joints have, are other parts.
    """
    faces = mesh.boundary_faces()[0]
    inner = np.zeros(len(faces), dtype=bool)
    for vertices in bones:
        inner |= np.isin(faces, vertices).all(axis=1)
    free = faces[~inner]
    part = component_labels(free)
    farthest = mesh.vertices[free, 0].max(axis=1).argmax()
    return free[part == part[farthest]]


def bone_weights(point: Array, mesh: TetMesh, bone: IntArray, count: int) -> sp.lil_matrix:
    """Weights (1, count) of the bone's vertices that give the point (3,) of its surface nearest to a point.

    Raises
    ------
    InputError
        If the point is farther than REACH from the bone.
    """
    faces = bone_faces(mesh, bone)
    distance, triangle, closest = Distance(Surface(mesh.vertices, faces)).closest(point[None])
    if distance[0] > REACH:
        problem = f"a point at {np.round(point, 2)} is {distance[0]:.2f} mm away from its bone"
        raise InputError("strand", "bones", problem, "Let it end on the bone's surface")
    corners = faces[triangle[0]]
    weights = sp.lil_matrix((1, count))
    weights[0, corners] = barycentric_weights(closest, mesh.vertices[corners][None])[0]
    return weights
