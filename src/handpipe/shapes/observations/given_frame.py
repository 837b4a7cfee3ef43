"""Whether template, marks, pairs of points and image can belong together, before hours of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError
from handpipe.imaging.volumes import Volume, likely_cause, unit_of
from handpipe.mesh.surfaces import Distance
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs

# Times as large or as small as its template is no organ; the least mistake of a unit makes ten.
LARGER = 6.0
OFF = 0.25  # of the template's size: points of the template are nearer to it
SPREAD = 0.05  # of the template's size: the extent of points in it
INSIDE = 0.9  # of the template's vertices: so many are in the image


@dataclass(frozen=True)
class Sources:
    """What messages call the template, its marks, attachments and landmarks: files, for people."""

    template: str | Path = "template"
    marks: str | Path = "marks"
    attachments: str | Path = "attachments"
    landmarks: str | Path = "landmarks"


def require_sizes(
    template: TetMesh, marks: Array, pairs: Mapping[str | Path, Pairs], sources: Sources
) -> None:
    """Compare the sizes of the template, of marks (r, 3) and of pairs, by their source.

    Raises
    ------
    InputError
        Where points of pairs are not on the template, or targets or marks are so much larger or smaller than
        the template that they are in another unit.
    """
    size = _size(template)
    for source, given in pairs.items():
        _require_on_template(source, template, given.points)
        if len(given.points) > 1:
            ratio = _spread(given.targets) / max(_spread(given.points), 1e-300)
            _require_ratio(source, "targets", ratio, 1 / LARGER, LARGER, size, sources)
    if len(marks) > 1:
        ratio = _spread(marks) / _spread(template.vertices[template.boundary_vertices()])
        _require_ratio(sources.marks, "marks", ratio, 0.0 if pairs else 1 / LARGER, LARGER, size, sources)


def require_reached(start: TetMesh, marks: Array, outliers: bool, sources: Sources) -> None:
    """Raise `InputError` for marks (r, 3) farther from the placed template than its size.

    With `outliers` they may be, since a fit then leaves out those that are far beyond the others.
    """
    if len(marks) == 0 or outliers:
        return
    distances = Distance(start.boundary().compact()).closest(marks)[0]
    far = np.flatnonzero(distances > _size(start))
    if len(far):
        place = ", ".join(f"{c:.0f}" for c in marks[far[0]])
        problem = f"{len(far)} of {len(marks)} are farther from the placed template than its size, "
        problem += f"the first is mark {far[0]} at ({place}), {distances[far[0]]:.0f} mm away"
        remedy = "Remove them, or let the fit leave out marks far beyond the others (--outliers)"
        raise InputError(sources.marks, "marks", problem, remedy)


def require_in_image(start: TetMesh, volume: Volume, sources: Sources) -> None:
    """Raise `InputError` unless the placed template lies in the image, with the likely cause."""

    def inside(matrix: Array) -> float:
        indices = volume.to_index(start.vertices @ matrix.T)
        return float(((indices >= -0.5) & (indices <= np.array(volume.shape) - 0.5)).all(axis=1).mean())

    share = inside(np.eye(3))
    if share < INSIDE:
        cause = likely_cause(inside)
        problem = f"{100 * share:.0f} % of its vertices are in the image once it is placed"
        remedy = f"It would fit if it is in {cause}" if cause else "Give landmarks that place it, or marks"
        raise InputError(sources.template, "frame", problem, remedy)


def _require_on_template(source: str | Path, template: TetMesh, points: Array) -> None:
    surface, size = Distance(template.boundary().compact()), _size(template)

    def near(matrix: Array) -> float:
        distances, *_ = surface.signed(points @ matrix.T)
        return float((distances < OFF * size).mean())

    def spread_out(matrix: Array) -> float:
        """A unit that shrinks all points to one place explains nothing."""
        extent = float(np.ptp(points @ matrix.T, axis=0).max())
        return near(matrix) if len(points) == 1 or extent > SPREAD * size else 0.0

    if near(np.eye(3)) < 1.0:
        worst = float(surface.signed(points)[0].max())
        problem = f"points of the template are up to {worst:.3g} mm away from it; its size is {size:.3g} mm"
        cause = likely_cause(spread_out)
        other = likely_cause(lambda matrix: spread_out(np.asarray(np.linalg.inv(matrix), float)))
        remedy = f"They would fit if they are in {cause}" if cause else "Place them on the template"
        if cause is None and other is not None:
            remedy = f"They would fit if the template is in {other}"
        raise InputError(source, "points", problem, remedy)


def _require_ratio(
    source: str | Path, what: str, ratio: float, least: float, most: float, size: float, sources: Sources
) -> None:
    if least <= ratio <= most:
        return
    unit = unit_of(1 / max(ratio, 1e-300), size)
    if unit is not None:  # the template is the smaller one
        name, remedy = sources.template, f"Is it in {unit}?"
    elif (unit := unit_of(ratio, ratio * size)) is not None:
        name, remedy = source, f"Are they in {unit}?"
    else:
        name, remedy = source, "Give both in mm"
    problem = f"the {what} are {ratio:.3g} times as large as the template"
    raise InputError(name, "units", problem, remedy)


def _spread(points: Array) -> float:
    """Root mean square distance in mm of points (k, 3) from their mean."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _size(mesh: TetMesh) -> float:
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
