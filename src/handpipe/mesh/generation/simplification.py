"""A coarser copy of a surface, for what varies slowly along it."""

from __future__ import annotations

import igl
import numpy as np

from handpipe.mesh.generation.surface_repair import repair
from handpipe.mesh.surfaces.surface import Surface


def simplified(surface: Surface, edge: float) -> Surface:
    """A surface with as many triangles as equilateral ones of an edge length would be.

    Parameters
    ----------
    surface : Surface
        Surface in mm, open or closed. It is repaired, and so closed, where it is no manifold.
    edge : float
        Edge length in mm. A surface that is not finer is returned as it is, and one that is no manifold even
        when repaired.

    Returns
    -------
    Surface
        Triangles are smaller where the surface is curved, larger where it is flat.

    References
    ----------
    Garland and Heckbert 1997.
    """
    count = int(surface.area() / (np.sqrt(3) / 4 * edge**2))
    if len(surface.triangles) <= count:
        return surface
    found = _decimated(surface, count)
    if found is None:
        found = _decimated(repair(surface)[0], count)
    return surface if found is None else found


def _decimated(surface: Surface, count: int) -> Surface | None:
    """A copy of `count` triangles; None where the surface is no manifold."""
    vertices, triangles = igl.qslim(surface.vertices, surface.triangles, count)[:2]
    return Surface(vertices, np.asarray(triangles, dtype=np.int64)) if len(triangles) else None
