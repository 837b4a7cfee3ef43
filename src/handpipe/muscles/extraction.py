"""Stage 1: the shape of one muscle in one pose, from the image of that pose (000 section 4.2, 003 section 6.1)."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handpipe import artifacts
from handpipe.imaging.markers import MarkerSettings, boundary_markers
from handpipe.imaging.volume import Volume
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.metrics import Metrics
from handpipe.muscles.body import Body
from handpipe.muscles.correspondence import Markers, fixed_markers
from handpipe.muscles.shape import FindMarkers, ShapeFit, ShapeOptions, fit_shape
from handpipe.muscles.templates import Guess

Array = NDArray[np.float64]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Extraction:
    """A muscle in one pose: surface and mesh vertices (n, 3), and how they were found."""

    surface: Surface
    vertices: Array
    fit: ShapeFit

    def metrics(self) -> Metrics:
        """The last step's figures, and the number of steps."""
        last = self.fit.record[-1]
        return {
            "marker_error_mean": (last.marker_mean, "mm"),
            "marker_error_max": (last.marker_max, "mm"),
            "attachment_error_max": (last.attachment_max, "mm"),
            "strain_eigenvalue_min": (last.eigenvalue, "1"),
            "iterations": (float(len(self.fit.record)), "1"),
        }


def extract_neutral(
    guess: Guess,
    volume: Volume,
    *,
    edge: float = 1.8,
    points: Array | None = None,
    markers: MarkerSettings | None = None,
    options: ShapeOptions | None = None,
) -> tuple[Body, Extraction]:
    """The neutral shape from a placed template, and the body that later stages deform.

    The fitted surface is filled with new tetrahedra of about `edge` mm, since fitting has strained the first ones.
    points (r, 3): hand-placed markers, in place of those found in the image.
    """
    first = Body.of(guess.surface, guess.attachments, edge)
    still = {bone: RigidTransform.identity() for bone in guess.attachments}
    extraction = _extract(first, still, first.mesh.vertices, volume, points, markers, options)
    body = Body.of(extraction.surface, guess.attachments, edge)
    return body, replace(extraction, vertices=body.mesh.vertices)


def extract_pose(
    body: Body,
    bones: Mapping[str, Surface],
    transforms: Mapping[str, RigidTransform],
    volume: Volume,
    *,
    start: Array | None = None,
    points: Array | None = None,
    markers: MarkerSettings | None = None,
    options: ShapeOptions | None = None,
) -> Extraction:
    """The shape in an example pose, from the neutral body held by the moved bones.

    bones: neutral bone surfaces; transforms: from neutral into the volume's frame; start: mesh vertices (n, 3) of a
    better first guess, as simulated from poses already known.
    """
    x = body.follow(bones, transforms) if start is None else start
    return _extract(body, transforms, x, volume, points, markers, options)


def _extract(
    body: Body,
    transforms: Mapping[str, RigidTransform],
    start: Array,
    volume: Volume,
    points: Array | None,
    markers: MarkerSettings | None,
    options: ShapeOptions | None,
) -> Extraction:
    find = image_markers(volume, body, markers) if points is None else fixed_markers(points)
    fit = fit_shape(
        body.mesh, body.surface, body.matrix, body.attached(transforms), find, start=start, options=options
    )
    surface = body.surface_at(fit.vertices)
    return Extraction(surface, fit.vertices, fit)


def image_markers(volume: Volume, body: Body, settings: MarkerSettings | None = None) -> FindMarkers:
    """Boundary markers found in an image along the normals of the present surface, away from attachments."""
    forbid = np.zeros(len(body.surface.vertices), dtype=bool)
    forbid[body.held] = True

    def find(surface: Surface) -> Markers:
        found = boundary_markers(volume, surface, settings, forbid)
        return Markers(found.points, found.confidence, found.vertices)

    return find


def save(path: str, extraction: Extraction, inputs: tuple[str, ...] = (), body: Body | None = None) -> None:
    """Write a muscle's shape in one pose, and in neutral the body itself."""
    data = {
        "shape/vertices": extraction.surface.vertices,
        "shape/triangles": extraction.surface.triangles,
        "shape/mesh_vertices": extraction.vertices,
        "record": extraction.fit.table(),
    }
    if body is not None:
        data["body"] = body.to_group()
    kind = "muscle-neutral" if body is not None else "muscle-shape"
    artifacts.write(path, data, kind=kind, units={"shape": "mm"}, inputs=inputs)


def load_neutral(path: str) -> Body:
    """The body that `save` wrote in neutral."""
    return Body.from_group(artifacts.read(path, "muscle-neutral")["body"])


def load_shape(path: str) -> tuple[Surface, Array]:
    """Surface and mesh vertices (n, 3) that `save` wrote in an example pose."""
    shape = artifacts.read(path, "muscle-shape")["shape"]
    return Surface(shape["vertices"], shape["triangles"]), shape["mesh_vertices"]
