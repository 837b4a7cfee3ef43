"""Muscles against known ones, muscle by muscle, and how deep organs lie in one another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.evaluation.surfaces import symmetric_distance
from handpipe.evaluation.table import STATISTICS, Row
from handpipe.mesh.surfaces import Distance, Surface


def surface_errors(found: Mapping[str, Surface], true: Mapping[str, Surface]) -> dict[str, Array]:
    """Distances between found and true surfaces, both ways, of the muscles that are in both mappings.

    Parameters
    ----------
    found, true : mapping of str to Surface
        Surfaces in mm by muscle.

    Returns
    -------
    mapping of str to array (n,)
        Distances in mm by muscle, see `symmetric_distance`.
    """
    return {name: symmetric_distance(found[name], true[name]) for name in found if name in true}


def error_rows(errors: Mapping[str, Mapping[str, Array]], roles: Mapping[str, str]) -> list[Row]:
    """Rows of a table of errors, one for each pose and muscle.

    Parameters
    ----------
    errors : mapping of str to mapping of str to array (n,)
        Distances in mm by pose and muscle.
    roles : mapping of str to str
        Role of each pose.

    Returns
    -------
    list of Row
        Rows with `muscle`, `pose`, `role`, and `mean`, `median`, `max` in mm.
    """
    return [
        {"muscle": muscle, "pose": pose, "role": roles[pose]} | {k: f(d) for k, f in STATISTICS.items()}
        for pose, by_muscle in errors.items()
        for muscle, d in by_muscle.items()
    ]


def deepest(
    muscles: Mapping[str, Surface], attached: Mapping[str, IntArray], bones: Iterable[Surface]
) -> float:
    """Largest depth of a free vertex of a muscle in a bone or in another muscle.

    Parameters
    ----------
    muscles : mapping of str to Surface
        Closed surfaces in mm by muscle.
    attached : mapping of str to array (k,)
        Indices of the vertices of each muscle that are attached to bones, and so may lie in them.
    bones : iterable of Surface
        Closed surfaces in mm.

    Returns
    -------
    float
        Depth in mm; 0 without penetration.
    """
    closed = {f"bone {i}": Distance(bone) for i, bone in enumerate(bones)}
    closed |= {name: Distance(surface) for name, surface in muscles.items()}
    free = {name: np.delete(surface.vertices, attached[name], axis=0) for name, surface in muscles.items()}
    return max(
        float(other.depths(points).max(initial=0.0))
        for name, points in free.items()
        for label, other in closed.items()
        if label != name
    )
