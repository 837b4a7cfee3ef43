"""A scan of the skin as a person gives it: one surface, perhaps with holes, without loose parts."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from handpipe.core import InputError
from handpipe.mesh.files.surface_files import read_surface
from handpipe.mesh.surfaces import Distance, Surface, component_labels, concatenate

log = logging.getLogger(__name__)

DUST = 0.01  # of the largest part's area: smaller parts are removed
NAMED = 3  # islands that a message describes


def read_scan(path: str | Path) -> Surface:
    """Read a scan as `read_surface` does, without unused vertices and without dust.

    Parts below a hundredth of the largest part's area are dust; the log names them.

    Parameters
    ----------
    path : path
        PLY, OBJ or STL file, in mm.

    Returns
    -------
    Surface
        Vertices in mm, in the file's order.

    Raises
    ------
    InputError
        As `read_surface`, and where a larger part touches no other part.
    """
    surface = read_surface(path)
    labels = component_labels(surface.triangles)
    areas = np.bincount(labels, surface.triangle_areas())
    large = areas >= DUST * areas.max()
    if not large.all():
        dust = Surface(surface.vertices, surface.triangles[~large[labels]]).compact()
        log.warning(
            "%s: left out %d loose parts of less than %g %% of the largest part's area: %s",
            *(path, np.count_nonzero(~large), 100 * DUST, _described(dust, surface.area())),
        )
        surface = Surface(surface.vertices, surface.triangles[large[labels]])
    parts = surface.components()
    islands = _islands(parts)
    if islands:
        named = "; ".join(_described(part, surface.area()) for part in islands[:NAMED])
        problem = f"{len(islands)} of {len(parts)} parts touch no other: {named}"
        raise InputError(path, "parts", problem, "Remove them in a mesh editor, or join them to the skin")
    return surface.compact()


def _islands(parts: list[Surface]) -> list[Surface]:
    """Parts that do not touch the largest one, directly or through other parts."""
    if len(parts) < 2:
        return []
    reach = float(np.median(np.concatenate([part.edge_lengths() for part in parts])))
    joined, left = [parts[0]], parts[1:]
    while True:
        together = Distance(concatenate(joined))
        near = [float(together.closest(part.vertices)[0].min()) <= reach for part in left]
        if not any(near):
            return left
        joined += [part for part, is_near in zip(left, near, strict=True) if is_near]
        left = [part for part, is_near in zip(left, near, strict=True) if not is_near]


def _described(part: Surface, area: float) -> str:
    place = ", ".join(f"{c:.0f}" for c in np.round(part.vertices.mean(axis=0)) + 0.0)
    return f"{100 * part.area() / area:.2g} % of the area near ({place})"
