"""Remeshing with small triangles in a region and a graded change around it (Wang 2019 §5.1)."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray
from handpipe.mesh.generation.remeshing import remesh, remesh_free
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

RATIO = 1.6  # of edge lengths of neighbouring rings
WIDTH = 2.0  # edges that a ring is wide


def remesh_graded(surface: Surface, region: BoolArray, fine: float, coarse: float) -> Surface:
    """The same closed surface with short edges in a region, and long ones far from it.

    All is remeshed at the coarse length first. Then rings around the region are remeshed in turn, each finer
    than the one before; the triangles outside of a ring are kept.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm, n vertices.
    region : array (n,) of bool
        Vertices of the region.
    fine, coarse : float
        Edge lengths in mm in the region and far from it.

    Returns
    -------
    Surface
        Its vertices lie on the input surface.

    Raises
    ------
    InputError
        Where the surface is open.

    References
    ----------
    Wang 2019 §5.1: regions are remeshed one after the other, for a single pass makes bad triangles.
    """
    found = remesh(surface, max(fine, coarse))
    if not region.any() or fine >= coarse:
        return found
    distance, near = Distance(surface), cKDTree(surface.vertices[region])

    def project(points: Array) -> Array:
        return distance.closest(points)[2]

    count = int(np.ceil(np.log(coarse / fine) / np.log(RATIO)))
    sizes = fine * (coarse / fine) ** (np.arange(count)[::-1] / count)
    reach = WIDTH * np.append(np.cumsum(sizes[::-1])[::-1][1:], 0.0) + surface.edge_lengths().mean()
    for size, radius in zip(sizes, reach, strict=True):
        fixed = near.query(found.vertices)[0] > radius
        found = remesh_free(found, float(size), fixed, project)
    return found
