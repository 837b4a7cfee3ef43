"""The convex hull of points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from handpipe.core import Array
from handpipe.mesh.surfaces.surface import Surface


def convex_hull(points: Array) -> Surface:
    """The closed convex hull of points, facing outwards.

    Parameters
    ----------
    points : array (n, 3)
        Points in mm.

    Returns
    -------
    Surface
        Its vertices are the points on the hull, in the order of the points.
    """
    hull = ConvexHull(points)
    a, b, c = np.moveaxis(points[hull.simplices], 1, 0)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    return Surface(points, triangles).compact()
