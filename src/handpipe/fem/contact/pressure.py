"""Pressure of contact on a surface, from the potentials that keep it out of other surfaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handpipe.core import Array
from handpipe.fem.potentials import Potential
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import mass_lumped


def contact_pressures(potentials: Sequence[Potential], surface: Surface) -> Array:
    """Contact forces on the vertices of a surface, inwards, over the area of each vertex.

    Parameters
    ----------
    potentials : sequence of Potential
        Potentials of the surface's vertices. Only one-sided ones are contact.
    surface : Surface
        Surface in mm with outward triangles, n vertices.

    Returns
    -------
    array (n,)
        Pressures in kPa, zero where nothing touches. Where facets that push on a vertex face away from its
        normal, the pressure is negative.
    """
    gradient = np.zeros_like(surface.vertices)
    for potential in potentials:
        if getattr(potential, "one_sided", False):
            gradient += potential.gradient(surface.vertices)
    inwards = np.einsum("ni,ni->n", gradient, surface.vertex_normals())
    return inwards / mass_lumped(surface.vertices, surface.triangles)
