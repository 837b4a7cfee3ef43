"""How deep and how sharp skin folds."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces import Surface

AROUND = 3.0  # mm in neutral of the surroundings that a fold is compared with


def fold_form(rest: Surface, moved: Surface, folding: IntArray) -> dict[str, float]:
    """Figures of the folds of a skin.

    `fold_depth`: how much farther a vertex lies beneath the mean of its surroundings than in neutral, at most
    (mm). `fold_angle`: by how much two neighbouring triangles are turned towards one another, at most
    (degrees): zero for flat skin, 180 for sheets that lie on one another.
    """
    inside = np.zeros(len(rest.vertices), dtype=bool)
    inside[folding] = True
    depth = _depths(moved, folding, rest) - _depths(rest, folding, rest)
    angles = _concave_angles(moved, inside)
    return {
        "fold_depth": float(depth.max(initial=0.0)),
        "fold_angle": float(np.degrees(angles.max(initial=0.0))),
    }


def _depths(surface: Surface, folding: IntArray, rest: Surface) -> Array:
    """Depths (f,) in mm of vertices beneath the mean of those within 3 mm of them in neutral."""
    near = cKDTree(rest.vertices).query_ball_point(rest.vertices[folding], AROUND)
    counts = np.array([len(ids) for ids in near])
    rows = np.repeat(np.arange(len(folding)), counts)
    shape = (len(folding), len(rest.vertices))
    means = sparse.csr_matrix((1 / counts[rows], (rows, np.concatenate(near))), shape=shape)
    out = means @ surface.vertices - surface.vertices[folding]
    depths: Array = np.einsum("ni,ni->n", out, surface.vertex_normals()[folding])
    return depths


def _concave_angles(surface: Surface, inside: BoolArray) -> Array:
    """Angles in rad between the normals of neighbouring triangles at concave edges whose ends are inside."""
    directed = np.concatenate([surface.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    order = np.lexsort(np.sort(directed, axis=1).T)
    owners = np.tile(np.arange(len(surface.triangles)), 3)[order].reshape(-1, 2)
    owners = owners[inside[directed[order][::2]].all(axis=1)]
    normals = surface.triangle_normals()[owners]
    centres = surface.vertices[surface.triangles[owners]].mean(axis=2)
    concave = np.einsum("ei,ei->e", centres[:, 1] - centres[:, 0], normals[:, 0]) > 0
    cosines = np.einsum("ei,ei->e", normals[:, 0], normals[:, 1])[concave]
    angles: Array = np.arccos(np.clip(cosines, -1.0, 1.0))
    return angles
