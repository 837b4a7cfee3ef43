"""What methods made of the bodies, side by side, and how their measures go with refinement."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.fem.machine import Figures
from benchmarks.shapes.comparison_bodies import Body
from handpipe.core import Array, atomic
from handpipe.evaluation.rendering import Camera, Drawable, Image, render
from handpipe.mesh.surfaces import Surface, concatenate

LABELS = {
    "truth": "truth",
    "plastic": "plastic strains (ours)",
    "plastic_attached": "plastic strains (ours), ends attached",
    "arap_volume": "as rigid as possible, volume",
    "arap_surface": "as rigid as possible, surface",
    "biharmonic_volume": "biharmonic, volume",
    "biharmonic_linear": "biharmonic, linear precision",
    "biharmonic_surface": "biharmonic, surface",
    "bounded_biharmonic": "bounded biharmonic weights",
    "bending": "bending, rotations",
    "bending_incremental": "bending, incremental plasticity",
    "primo": "coupled prisms (PriMo)",
    "elastic": "elastic",
    "elastic_incremental": "elastic, incremental plasticity",
    "transfer": "deformation transfer, elastic",
    "icp_amberg": "non-rigid ICP, Amberg",
    "icp_sumner": "non-rigid ICP, Sumner",
}
VIEWS = {
    "beam": ((1.0, 0.9, -0.7), (0, 0, 1)),
    "muscle": ((0.2, 0.4, -1), (0, 1, 0)),
    "bump": ((0.6, 1.0, -0.7), (0, 0, 1)),
    "cylinder": ((0.0, 1.0, -0.2), (0, 0, 1)),
    "twist": ((0.3, 1.0, -0.6), (0, 0, 1)),
    "cactus": ((-0.5, 0.8, -0.6), (1, 0, 0)),
}
TILES = {"beam": (300, 240), "muscle": (300, 130)}  # pixels
COLUMNS = 5
FLESH, MARK, ATTACHED = (0.8, 0.45, 0.4), (0.1, 0.2, 0.9), (0.05, 0.05, 0.05)
CURVES = {"spikiness": "largest over mean\nchange of curvature", "surface_max": "surface, largest error [mm]"}


def draw(
    path: Path,
    shapes: Mapping[str, Mapping[str, Array]],
    bodies: Mapping[str, Body],
    figures: Figures,
    refinements: int,
) -> None:
    """Curves over all refinements, and pictures of shapes (n, 3) by body and method on the finest mesh."""
    rows = {name: -(-len(found) // COLUMNS) for name, found in shapes.items()}
    heights = [1.5] + [TILES[name][1] / 240 for name in shapes for _ in range(rows[name])]
    figure = Figure(figsize=(12, 2.3 * sum(heights)), layout="constrained")
    ratios = _ratios(heights, rows)
    parts = cast("NDArray[np.object_]", figure.subfigures(len(ratios), 1, height_ratios=ratios))
    axes = parts[0].subplots(1, len(shapes) * len(CURVES))
    for ax, (name, curve) in zip(axes, [(n, c) for n in shapes for c in CURVES], strict=True):
        _curves(ax, name, curve, figures, refinements)
    handles, labels = axes[0].get_legend_handles_labels()
    parts[0].legend(handles, labels, loc="outside lower center", ncols=COLUMNS, fontsize=8, frameon=False)
    for part, (name, found) in zip(parts[1:], shapes.items(), strict=True):
        tiles = part.subplots(rows[name], COLUMNS, squeeze=False).ravel()
        camera = camera_of(name, bodies[name], TILES[name])
        for tile in tiles:
            tile.axis("off")
        for tile, (method, x) in zip(tiles, found.items(), strict=False):
            tile.imshow(picture(bodies[name], x, camera, TILES[name]))
            tile.set_title(LABELS[method], fontsize=9)
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, format="png", dpi=100)


def _ratios(heights: list[float], rows: Mapping[str, int]) -> list[float]:
    ratios, at = heights[:1], 1
    for count in rows.values():
        ratios.append(sum(heights[at : at + count]))
        at += count
    return ratios


def _curves(ax: Axes, name: str, curve: str, figures: Figures, refinements: int) -> None:
    steps = range(refinements + 1)
    for number, (method, label) in enumerate(LABELS.items()):
        found = [figures.get(f"comparison_{name}_{method}_{curve}_{k}", {}).get("value") for k in steps]
        values = [value for value in found if isinstance(value, float)]
        if len(values) == len(steps):
            width = 2.5 if method == "plastic" else 1.0
            style = "k--" if method == "truth" else f"C{number}o-"
            ax.plot(steps, values, style, label=label, linewidth=width, markersize=3)
    ax.set_yscale("log")
    ax.set_xticks(list(steps))
    ax.set_xlabel("refinements", fontsize=8)
    ax.set_title(f"{name}: {CURVES[curve]}", fontsize=9)
    ax.tick_params(labelsize=8, which="both")


def camera_of(name: str, body: Body, size: tuple[int, int]) -> Camera:
    """A camera that sees the body's true shape."""
    direction, up = VIEWS[name]
    surface = Surface(body.truth, body.mesh.boundary_faces()[0]).compact()
    return Camera.fit(surface.vertices, np.array(direction), np.array(up), size, margin=1.15)


def picture(body: Body, x: Array, camera: Camera, size: tuple[int, int], points: bool = True) -> Image:
    """The surface at x, and where its marks and attachments belong."""
    surface = Surface(x, body.mesh.boundary_faces()[0]).compact()
    drawn = [Drawable(surface, FLESH)]
    if points:
        drawn += [
            Drawable(_balls(body.truth[body.marked]), MARK),
            Drawable(_balls(body.truth[body.attached]), ATTACHED),
        ]
    return render(drawn, camera, size)


def _balls(points: Array, radius: float = 0.6) -> Surface:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return concatenate(
        [Surface(np.asarray(ball.vertices) + point, np.asarray(ball.faces)) for point in points]
    )
