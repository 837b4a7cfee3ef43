"""Attachments inside a neighbour: of muscles that spring from one place, marks reach into one another."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handpipe.mesh.distance import Distance
from handpipe.muscles.body import Body

Array = NDArray[np.float64]
log = logging.getLogger(__name__)

FREE = 0.1  # mm out of every other muscle, at least, where a bone may hold one
LEAST = 3  # vertices that each bone goes on holding


def uncontested(bodies: Mapping[str, Body], least: int = LEAST) -> dict[str, Body]:
    """The same bodies, no longer held where that is inside another one.

    What holds a vertex there forbids that the two be parted. Each bone keeps `least` vertices, those that
    lie farthest out of the others, if more of its are inside.
    """
    surfaces = {name: Distance(body.surface) for name, body in bodies.items()}
    found = {}
    for name, body in bodies.items():
        others = [distance for other, distance in surfaces.items() if other != name]
        kept = {
            bone: ids[_kept(_gaps(body.surface.vertices[ids], others), least)]
            for bone, ids in body.attachments.items()
        }
        dropped = len(body.held) - sum(map(len, kept.values()))
        if dropped:
            log.info("%s: %d of %d held vertices are in other muscles", name, dropped, len(body.held))
        found[name] = replace(body, attachments=kept)
    return found


def _gaps(points: Array, others: list[Distance]) -> Array:
    """Signed distance (n,) in mm from the nearest of the others."""
    alone = np.full(len(points), np.inf)
    return np.min([alone, *(other.signed(points)[0] for other in others)], axis=0)


def _kept(gaps: Array, least: int) -> NDArray[np.int64]:
    order = np.argsort(-gaps, kind="stable")
    count = max(int((gaps > FREE).sum()), min(least, len(gaps)))
    return np.sort(order[:count])
