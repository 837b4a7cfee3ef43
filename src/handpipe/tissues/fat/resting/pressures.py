"""Pressure of a tissue's contact: of its skin on itself, and of the tissue on the bodies below."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array
from handpipe.fem.contact import Contact, contact_pressures
from handpipe.mesh.tets import mass_lumped
from handpipe.tissues.fat.resting.load_case import LoadCase
from handpipe.tissues.fat.skin_contact import skin_on_skin


def pressures_at(case: LoadCase, x: Array) -> dict[str, dict[str, Array]]:
    """Contact pressures of a tissue in a frame.

    Parameters
    ----------
    case : LoadCase
        The tissue in the frame.
    x : array (n, 3)
        Its vertices in mm.

    Returns
    -------
    dict of str to dict of str to array
        Pressures in kPa by layer and body; the skin's layer is "". That of the skin on itself and of bones on
        the skin is by skin vertex (k,), that of the tissue on a body below by its vertex; the latter is zero
        where the tissue is fixed or slides.
    """
    return {"": {"skin": _on_skin(case, x) + _of_bones(case, x)}, **_on_bodies(case, x)}


def _of_bones(case: LoadCase, x: Array) -> Array:
    """Pressure (k,) of bones on the skin above them, which it moves outwards."""
    skin = case.skin(x)
    identity = sparse.identity(len(skin.vertices), format="csr")
    return -contact_pressures(case.bones_on_skin(skin, identity, case.tissue.settings.stiffness), skin)


def _on_skin(case: LoadCase, x: Array) -> Array:
    """Pressure (k,) of the skin on itself: the barrier's, or the planes' where it crosses itself."""
    tissue, skin = case.tissue, case.skin(x)
    barrier = tissue.skin_barrier()
    if barrier is not None and not barrier.intersects(x):
        areas = mass_lumped(skin.vertices, skin.triangles)
        return -np.einsum("ni,ni->n", barrier.surface_forces(x), skin.vertex_normals()) / areas
    stiffness = tissue.settings.stiffness * tissue.skin_areas
    identity = sparse.identity(len(stiffness), format="csr")
    return contact_pressures(skin_on_skin(tissue.skin, skin, identity, stiffness), skin)


def _on_bodies(case: LoadCase, x: Array) -> dict[str, dict[str, Array]]:
    """Pressure (v,) of the tissue on the bodies that it touches, over their vertices' posed areas."""
    inner, ids = case.tissue.inner, case.tissue.touching
    given = case.on_bodies(x, case.tissue.settings.stiffness)
    contacts = [c for c in given if isinstance(c, Contact)]
    force = np.zeros(len(inner.rest))
    force[ids] = np.sum([np.linalg.norm(c.forces(c.points(x)), axis=1) for c in contacts], axis=0)
    found: dict[str, dict[str, Array]] = {}
    for body, surface in enumerate(inner.surfaces(case.below)):
        mine = ids[inner.body[ids] == body]
        if len(mine):
            total = np.zeros(len(surface.vertices))
            np.add.at(total, inner.vertex[mine], force[mine])
            pressure = total / mass_lumped(surface.vertices, surface.triangles)
            found.setdefault(inner.layers[body], {})[inner.bodies[body]] = pressure
    return found
