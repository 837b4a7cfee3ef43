"""Surfaces that cut themselves, as soft bodies do that fold, and distances to them."""

from __future__ import annotations

import numpy as np

from handpipe.mesh.contact.contact_toolkit import ipctk
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface


def cuts_itself(surface: Surface) -> bool:
    """Whether any two triangles that share no vertex intersect."""
    edges = np.ascontiguousarray(ipctk.edges(surface.triangles))
    mesh = ipctk.CollisionMesh(surface.vertices, edges, surface.triangles)
    return bool(ipctk.has_intersections(mesh, surface.vertices))


def distance_to(surface: Surface) -> Distance:
    """Distances whose signs hold although a soft body's surface may cut itself in its pose."""
    return Distance(surface, by_winding=cuts_itself(surface))
