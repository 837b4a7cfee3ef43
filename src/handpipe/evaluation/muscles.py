"""Muscles against known ones, muscle by muscle, and how deep organs lie in one another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.evaluation.surfaces import symmetric_distance
from handpipe.evaluation.table import STATISTICS, Row
from handpipe.mesh.surfaces import Distance, Surface


def surface_errors(found: Mapping[str, Surface], true: Mapping[str, Surface]) -> dict[str, Array]:
    """Distances in mm between found and true surfaces, both ways, of the muscles that are in both."""
    return {name: symmetric_distance(found[name], true[name]) for name in found if name in true}


def error_rows(errors: Mapping[str, Mapping[str, Array]], roles: Mapping[str, str]) -> list[Row]:
    """Rows with `muscle`, `pose`, `role`, and `mean`, `median`, `max` in mm, of distances by pose, muscle."""
    return [
        {"muscle": muscle, "pose": pose, "role": roles[pose]} | {k: f(d) for k, f in STATISTICS.items()}
        for pose, by_muscle in errors.items()
        for muscle, d in by_muscle.items()
    ]


def deepest(muscles: Mapping[str, Surface], held: Mapping[str, IntArray], bones: Iterable[Surface]) -> float:
    """How deep in mm a vertex of a muscle lies in a bone or in another muscle, at most.

    held: ids of the vertices of each muscle that bones hold, which lie in these by right.
    """
    closed = {f"bone {i}": Distance(bone) for i, bone in enumerate(bones)}
    closed |= {name: Distance(surface) for name, surface in muscles.items()}
    free = {name: np.delete(surface.vertices, held[name], axis=0) for name, surface in muscles.items()}
    return max(
        float(other.depths(points).max(initial=0.0))
        for name, points in free.items()
        for label, other in closed.items()
        if label != name
    )
