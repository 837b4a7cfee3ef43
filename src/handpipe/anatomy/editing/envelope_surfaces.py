"""Surfaces of muscles for display: where each muscle's function begins to be the largest.

Functions are compared at vertices only. The surface of a muscle goes through the zeros of its function minus
the largest other one on the edges of tets (Doi and Koide 1991). It is open where the muscle meets a bone or
the skin. Where three tissues meet, neighbouring surfaces may be apart by a part of a tet; `build_tissue_mesh`
cuts there exactly.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.anatomy.templates.diffusion import Functions
from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh


def envelope_surfaces(mesh: TetMesh, functions: Functions) -> dict[str, Surface]:
    """Surfaces of the muscles that are somewhere the largest tissue.

    Parameters
    ----------
    mesh : TetMesh
        Mesh of n vertices in mm.
    functions : Functions
        Values (n, k) of the tissues, of which the first is the fat.

    Returns
    -------
    dict of str to Surface
        By muscle; open where the muscle meets the boundary of the mesh. Normals point outwards.
    """
    values = functions.values
    labels = values.argmax(axis=1)
    if values.shape[1] < 2:
        return {}
    second, first = np.partition(values, -2, axis=1)[:, -2:].T
    corners = labels[mesh.tets]
    mixed = mesh.tets[(corners != corners[:, :1]).any(axis=1)]
    found = {}
    for label, name in enumerate(functions.names[1:], start=1):
        inside = labels == label
        if inside.any():
            excess = values[:, label] - np.where(inside, second, first)
            found[name] = _zero_surface(mesh.vertices, mixed, excess, inside)
    return found


def _zero_surface(vertices: Array, tets: IntArray, excess: Array, inside: BoolArray) -> Surface:
    """Triangles between vertices inside, where the excess (n,) is positive, and those outside."""
    edges = _cut_edges(vertices, tets, excess, inside)
    keys, triangles = np.unique(edges @ [len(vertices), 1], return_inverse=True)
    a, b = keys // len(vertices), keys % len(vertices)
    share = _share(excess[a], excess[b])[:, None]
    return Surface((1 - share) * vertices[a] + share * vertices[b], triangles.reshape(-1, 3))


def _share(inner: Array, outer: Array) -> Array:
    """Where (e,) on an edge from its inner end the zero is; in the middle of an edge of zeros."""
    size = inner - outer
    return np.where(size > 0, inner / np.where(size > 0, size, 1.0), 0.5)


@njit(cache=True)
def _cut_edges(vertices, tets, excess, inside):  # type: ignore[no-untyped-def]
    """Edges (3 t, 2), the inner end first, whose zeros are the corners of triangles that face outwards."""
    out = np.empty((6 * len(tets), 2), np.int64)
    count = 0
    ins, outs = np.empty(4, np.int64), np.empty(4, np.int64)
    chosen = np.empty((6, 2), np.int64)
    for t in range(len(tets)):
        n_in = n_out = 0
        for vertex in tets[t]:
            if inside[vertex]:
                ins[n_in] = vertex
                n_in += 1
            else:
                outs[n_out] = vertex
                n_out += 1
        if n_in == 0 or n_out == 0:
            continue
        if n_in == 2:
            number = 6
            for k, (i, o) in enumerate(((0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0))):
                chosen[k] = ins[i], outs[o]
        else:
            number = 3
            for k in range(3):
                chosen[k] = (ins[0], outs[k]) if n_in == 1 else (ins[k], outs[0])
        outwards = vertices[outs[0]] - vertices[ins[0]]
        for first in range(0, number, 3):
            corners = np.empty((3, 3))
            for k in range(3):
                a, b = chosen[first + k]
                size = excess[a] - excess[b]
                share = excess[a] / size if size > 0 else 0.5
                corners[k] = (1 - share) * vertices[a] + share * vertices[b]
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            turned = normal @ outwards < 0
            for k in range(3):
                out[count] = chosen[first + (2 - k if turned else k)]
                count += 1
    return out[:count]
