"""The four standard deformations of Botsch and Sorkine 2008, by ours and others (Wang 2021 Fig. 5.26)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import surface_errors
from benchmarks.shapes.comparison_bodies import Body
from benchmarks.shapes.comparison_picture import LABELS, camera_of, picture
from benchmarks.shapes.comparisons import shape_by
from benchmarks.shapes.other_methods import METHODS, plastic_attached
from benchmarks.shapes.standard_bodies import STANDARD, arms
from handpipe.core import Array, atomic
from handpipe.mesh.surfaces import Surface

PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "shapes-standard.png"
HERE = METHODS | {"plastic_attached": plastic_attached}
SHOWN = (
    "plastic_attached",
    "plastic",
    "arap_volume",
    "arap_surface",
    "biharmonic_volume",
    "biharmonic_surface",
    "bending",
    "bending_incremental",
    "primo",
    "elastic",
    "elastic_incremental",
    "transfer",
)
UNITS = {
    "surface_mean": "mm",
    "surface_max": "mm",
    "normals_max": "deg",
    "marks_max": "mm",
    "volume": "%",
    "arms": "%",
    "seconds": "s",
}


def measures(name: str, body: Body, x: Array) -> dict[str, float]:
    """By the names in `UNITS`, without the seconds; the cactus has arms that keep their shape in place of a
    true shape."""
    found = body.mesh.moved(x)
    volume = found.boundary().volume() / body.mesh.boundary().volume()
    marks = np.linalg.norm((x - body.truth)[body.marked], axis=1)
    out = {"volume": 100 * (volume - 1), "marks_max": float(marks.max())}
    if name == "cactus":
        return out | {"arms": 100 * _stretch(body, x)}
    errors = surface_errors(found, body.wanted)
    surface = body.mesh.boundary()
    here, wanted = (surface.moved(at).vertex_normals()[body.side] for at in (x, body.truth))
    angles = np.degrees(np.arccos(np.clip((here * wanted).sum(axis=1), -1.0, 1.0)))
    out |= {"surface_mean": float(errors.mean()), "surface_max": float(errors.max())}
    return out | {"normals_max": float(angles.max())}


def _stretch(body: Body, x: Array) -> float:
    """Largest relative change of an edge's length in the arms' surface."""
    faces = body.mesh.boundary_faces()[0]
    inside = arms(body.mesh)[faces].all(axis=1)
    i, j = Surface(body.mesh.vertices, faces[inside]).edges().T
    before = np.linalg.norm(body.mesh.vertices[i] - body.mesh.vertices[j], axis=1)
    return float(np.abs(np.linalg.norm(x[i] - x[j], axis=1) / before - 1).max())


def measure(
    bodies: tuple[str, ...] = tuple(STANDARD),
    methods: tuple[str, ...] = SHOWN,
    image: Path | None = PICTURE,
) -> Figures:
    """`standard_{deformation}_{method}_{measure}`."""
    out: Figures = {}
    shapes: dict[str, dict[str, Array]] = {}
    for name in bodies:
        body = STANDARD[name]()
        shapes[name] = {}
        for method in methods:
            key = f"standard_{name}_{method}_"
            found = shape_by(HERE[method], body, method)
            if isinstance(found, str):
                out |= {key + m: figure(None, unit, found) for m, unit in UNITS.items()}
                continue
            shapes[name][method] = found[0]
            values = measures(name, body, found[0]) | {"seconds": found[1]}
            out |= {key + m: figure(value, UNITS[m]) for m, value in values.items()}
    if image is not None:
        draw(image, shapes)
    return out


def draw(path: Path, shapes: Mapping[str, Mapping[str, Array]]) -> None:
    """A row a deformation, a column a method."""
    size = (240, 220)
    methods = [m for m in SHOWN if any(m in found for found in shapes.values())]
    drawing = Figure(figsize=(1.5 * len(methods), 1.5 * len(shapes)), layout="constrained")
    tiles = drawing.subplots(len(shapes), len(methods), squeeze=False)
    for row, (name, found) in zip(tiles, shapes.items(), strict=True):
        body = STANDARD[name]()
        camera = camera_of(name, body, size)
        for tile, method in zip(row, methods, strict=True):
            tile.axis("off")
            tile.set_title(LABELS[method].replace(", ", ",\n"), fontsize=7)
            if method in found:
                tile.imshow(picture(body, found[method], camera, size, points=False))
    FigureCanvasAgg(drawing)
    with atomic(path) as temporary:
        drawing.savefig(temporary, format="png", dpi=110)
