"""Organs given as surfaces: what is inside of them, where they overlap, and one mesh of them all.

The surfaces of real anatomy overlap, enter bones, cut themselves and have holes. Each organ gets one
function, how deep a point is in it; the upper envelope of these gives every place to one organ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.anatomy.improvement.cleaning import label_parts
from handpipe.anatomy.templates.diffusion import Factorise, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.fibres import harmonic_fibres
from handpipe.anatomy.templates.tissue_mesh import TissueMesh, numbered_surfaces, segment
from handpipe.core import Array, InputError, IntArray
from handpipe.mesh.surfaces import Distance, Surface, about
from handpipe.mesh.tets import tet_neighbours

Distances = Mapping[str, Distance]

REACH = 3.0  # mm outside of an organ up to which its function is a distance
ON_BONE = 1.2  # mm farther from a bone than an organ's nearest vertex, up to which it is attached there
SNAP = 0.2  # share of an edge by which borders may move to vertices
CRUMB = 0.25  # of an organ's largest part, in volume, below which a part is left out
GROWN = 0.15  # mm by which organs are made thicker, since smoothing their borders makes them thinner
PER_THICKNESS = 1.0  # edges of tets over an organ's thickness
FINEST, COARSEST = 1.2, 2.4  # mm


@dataclass(frozen=True, eq=False)
class OrganSolid:
    """A muscle of a source: surfaces that fill it together, and the bones at its ends.

    Parameters
    ----------
    surfaces : tuple of Surface
        Surfaces in mm. They may be open, and may overlap.
    origin : tuple of str
        Bones of its origin. Without one, for a muscle that springs from tendons, the origin is where the
        muscle is farthest from its insertion.
    insertion : tuple of str
        Bones of its insertion.
    """

    surfaces: tuple[Surface, ...]
    origin: tuple[str, ...]
    insertion: tuple[str, ...]

    def thickness(self) -> float:
        """About the radius in mm: twice the volume over the area."""
        return 2 * abs(sum(s.volume() for s in self.surfaces)) / sum(s.area() for s in self.surfaces)


def depth(surfaces: Sequence[Surface], points: Array) -> Array:
    """How deep in mm points (n, 3) are within any of some surfaces; negative outside, at least -REACH.

    Open surfaces count as closed, see `Surface.contains`.
    """
    found = np.full(len(points), -REACH)
    for surface in surfaces:
        near = about(points, surface, REACH)
        if len(near) == 0:
            continue
        distance = Distance(surface).closest(points[near])[0]
        found[near] = np.maximum(found[near], np.where(surface.contains(points[near]), distance, -distance))
    return found


def template_of(
    solids: Mapping[str, OrganSolid],
    domain: Domain,
    bones: Mapping[str, Surface],
    *,
    factorise: Factorise = superlu,
    source: str = "solids",
) -> TissueMesh:
    """Template of the space between skin and bones, filled with organs and fat.

    Each place belongs to the organ in which it is deepest; fat fills the rest.

    Parameters
    ----------
    solids : mapping of str to OrganSolid
        Organs by name.
    domain : Domain
        Tets between skin and bones; they are refined about thin organs.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.
    source : str
        The source of the organs, for messages.

    Returns
    -------
    TissueMesh
        Its `warnings` name organs that are in several parts.

    Raises
    ------
    InputError
        For an organ that is nowhere the deepest, or whose origin or insertion has no vertices of its own.
    """
    domain = _refined(domain, solids)
    values = np.zeros((len(domain.mesh.vertices), 1 + len(solids)))
    for column, solid in enumerate(solids.values(), start=1):
        values[:, column] = depth(solid.surfaces, domain.mesh.vertices) + GROWN
    labelled = segment(domain, values, snap=SNAP, crumb=CRUMB)
    names = ("fat", *solids)
    part = label_parts(labelled.labels, tet_neighbours(labelled.mesh.tets))
    directions = np.zeros((len(labelled.labels), 3))
    distances = {name: Distance(bone) for name, bone in bones.items()}
    origins, insertions, warnings = {}, {}, []
    for label, (name, solid) in enumerate(solids.items(), start=1):
        own = labelled.labels == label
        if not own.any():
            raise InputError(source, name, "is nowhere the deepest organ", "Choose shorter edges")
        if (count := len(np.unique(part[own]))) > 1:
            warnings.append(f"{name}: is in {count} parts")
        muscle, used = labelled.mesh.part(own)
        origin, insertion = ends(muscle.vertices, solid, distances)
        if len(origin) == 0 or len(insertion) == 0:
            raise InputError(source, name, "has one end only", "Name other bones for its ends")
        directions[own] = harmonic_fibres(muscle, origin, insertion, factorise=factorise)
        origins[name], insertions[name] = used[origin], used[insertion]
    on_surfaces = numbered_surfaces(domain)
    return TissueMesh(
        labelled.mesh, labelled.labels, names, directions, origins, insertions, *on_surfaces, tuple(warnings)
    )


def _refined(domain: Domain, solids: Mapping[str, OrganSolid]) -> Domain:
    """Finer tets about organs, the finer the thinner these are."""
    points, lengths = [], []
    for solid in solids.values():
        length = float(np.clip(PER_THICKNESS * solid.thickness(), FINEST, COARSEST))
        for surface in solid.surfaces:
            edges, triangles = (
                surface.vertices[c].mean(axis=1) for c in (surface.edges(), surface.triangles)
            )
            points.append(np.concatenate([surface.vertices, edges, triangles]))
            lengths.append(np.full(len(points[-1]), length))
    return domain.refined(np.concatenate(points), np.concatenate(lengths))


def ends(vertices: Array, solid: OrganSolid, bones: Distances) -> tuple[IntArray, IntArray]:
    """The vertices (n, 3) at a muscle's origin and at its insertion; none is at both."""
    insertion = _near(vertices, solid.insertion, bones)
    if solid.origin:
        origin = _near(vertices, solid.origin, bones)
    else:
        away = np.linalg.norm(vertices - vertices[insertion].mean(axis=0), axis=1)
        origin = np.flatnonzero(np.linalg.norm(vertices - vertices[away.argmax()], axis=1) < REACH)
    shared = np.intersect1d(origin, insertion)
    return np.setdiff1d(origin, shared), np.setdiff1d(insertion, shared)


def _near(vertices: Array, names: Sequence[str], bones: Distances) -> IntArray:
    """Vertices (k,) that are hardly farther from each of some bones than the nearest one."""
    found = []
    for name in names:
        distance = bones[name].closest(vertices)[0]
        found.append(np.flatnonzero(distance <= distance.min() + ON_BONE))
    return np.unique(np.concatenate(found))
