"""Surfaces that cut themselves, as soft bodies do that fold, and distances to them."""

from __future__ import annotations

import numpy as np

from handpipe.mesh.contact.contact_toolkit import ipctk
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface


def cuts_itself(surface: Surface) -> bool:
    """Whether any two triangles that share no vertex intersect.

    Parameters
    ----------
    surface : Surface
        Surface in mm.

    Returns
    -------
    bool
    """
    edges = np.ascontiguousarray(ipctk.edges(surface.triangles))
    mesh = ipctk.CollisionMesh(surface.vertices, edges, surface.triangles)
    return bool(ipctk.has_intersections(mesh, surface.vertices))


def distance_to(surface: Surface) -> Distance:
    """Distances to a surface that may cut itself, as that of a soft body in a pose.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm.

    Returns
    -------
    Distance
        If the surface cuts itself, the winding number decides the sign of a distance.
    """
    return Distance(surface, by_winding=cuts_itself(surface))
