"""How each vertex of a fascia is constrained: fixed, sliding or in contact, from geometry (Zheng 2022 §6).

The papers paint these regions by hand; here they follow from the distances to the bodies that the fascia
wraps and from where those are attached. A file of painted values overrides them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray, InputError, IntArray, Region
from handpipe.mesh.surfaces import Distance, Surface

BENEATH = 0.9  # of the radius: a point beneath a vertex that is less deep has another wall near


def distances_to(points: Array, bodies: Mapping[str, Surface]) -> Array:
    """Distances (n, n_bodies) in mm of points to each body's surface; zero inside."""
    return np.stack([np.maximum(Distance(b).signed(points)[0], 0.0) for b in bodies.values()], axis=1)


def slender(points: Array, bodies: Mapping[str, Surface], radius: float) -> BoolArray:
    """Points (n,) on bodies in which no ball of a radius in mm fits beneath them."""
    signed, _, closest, normals = zip(*(Distance(b).signed(points) for b in bodies.values()), strict=True)
    nearest = np.abs(signed).argmin(axis=0)
    every = np.arange(len(points))
    beneath = np.stack(closest)[nearest, every] - radius * np.stack(normals)[nearest, every]
    depth = -np.stack([Distance(b).signed(beneath)[0] for b in bodies.values()])[nearest, every]
    return depth < BENEATH * radius


def muscle_regions(
    points: Array,
    muscles: Mapping[str, Surface],
    attachments: Array,
    attached_radius: float,
    gap: float,
) -> IntArray:
    """Region of each vertex of a muscle fascia: fixed, contact or sliding.

    Vertices near insertions are fixed. Where two muscles meet, vertices are in contact; on one muscle alone
    they slide.

    Parameters
    ----------
    points : array (n, 3)
        Vertices in mm.
    muscles : mapping of str to Surface
        Neutral surfaces in mm.
    attachments : array (k, 3)
        Attached points of all muscles in mm.
    attached_radius : float
        Distance in mm from an attached point under which a vertex is fixed.
    gap : float
        Distance in mm of the second nearest muscle under which a vertex is in contact.

    Returns
    -------
    array (n,) of int
        Values of `Region`.
    """
    distances = np.sort(distances_to(points, muscles), axis=1)
    second = distances[:, 1] if distances.shape[1] > 1 else np.full(len(points), np.inf)
    regions = np.where(second < gap, Region.contact, Region.sliding)
    if len(attachments):
        near = np.linalg.norm(points[:, None] - attachments[None], axis=2).min(axis=1) < attached_radius
        regions = np.where(near, Region.fixed, regions)
    return regions.astype(np.int64)


def read_regions(path: str | Path, count: int) -> IntArray:
    """Regions that a person has painted, from a JSON list with one name for each vertex.

    Parameters
    ----------
    path : path
        JSON list of "contact", "sliding" and "fixed".
    count : int
        Number of vertices.

    Returns
    -------
    array (count,) of int
        Values of `Region`.

    Raises
    ------
    InputError
        Where the list has another length, or unknown names.
    """
    names = json.loads(Path(path).read_text(encoding="utf-8"))
    if len(names) != count:
        raise InputError(
            path, "regions", f"has {len(names)} values for {count} vertices", "Paint this fascia's mesh"
        )
    unknown = set(names) - {r.name for r in Region}
    if unknown:
        raise InputError(path, "regions", f"unknown {sorted(unknown)}", "Use contact, sliding or fixed")
    return np.array([Region[n] for n in names], dtype=np.int64)
