"""A ball is to become a muscle: `python -m benchmarks.shapes.real_organ muscle.ply folder`.

Writes template.vtk (a ball of the muscle's volume) and marks.mrk.json (points of its surface) for
`python -m handpipe.shapes`. When that has written folder/organ, the same command with --compare says how far
the two surfaces are apart and draws before, marks and after into folder/organ.png.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import meshio
import numpy as np
import trimesh

from benchmarks.shapes.bodies import scattered
from handpipe.core import Array
from handpipe.imaging.evidence import read_markers, write_markers
from handpipe.mesh.files import read_surface
from handpipe.mesh.generation import remesh, tetrahedralise
from handpipe.mesh.surfaces import Surface, sample_points
from handpipe.mesh.surfaces.distance import surface_errors as distances
from handpipe.shapes.organs.files import read_template

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.collections import PolyCollection  # noqa: E402

MARKS, EDGE = 800, 1.6
FINEST = 0.8  # mm: edges of the surface that marks are taken from
LIGHT = np.array([0.3, 0.4, 0.86])
SAMPLES = 20_000


def write_task(muscle: Surface, folder: Path) -> None:
    """template.vtk and marks.mrk.json."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    radius = (0.75 * muscle.volume() / np.pi) ** (1 / 3)
    shell = remesh(Surface(radius * ball.vertices + muscle.centroid(), ball.faces), EDGE)
    template = tetrahedralise(shell, EDGE)
    folder.mkdir(parents=True, exist_ok=True)
    meshio.write(folder / "template.vtk", meshio.Mesh(template.vertices, [("tetra", template.tets)]))
    write_markers(folder / "marks.mrk.json", scattered(remesh(muscle, FINEST), MARKS))


def compare(muscle: Surface, folder: Path) -> None:
    """Print the distances both ways and draw."""
    template = read_template(folder / "template.vtk").boundary().compact()
    found = read_surface(folder / "organ" / "surface.ply", closed=True)
    for name, a, b in (("fitted to muscle", found, muscle), ("muscle to fitted", muscle, found)):
        errors = distances(a, b, samples=SAMPLES)
        mean, most, largest = errors.mean(), np.quantile(errors, 0.95), errors.max()
        print(f"{name}: {mean:.3f} mm in the mean, {most:.2f} at 95 %, {largest:.2f} the largest")
    marks = read_markers(folder / "marks.mrk.json")[0]
    draw(folder / "organ.png", [(template, None), (template, marks), (found, None), (muscle, None)])


def draw(path: Path, shown: list[tuple[Surface, Array | None]]) -> None:
    """Surfaces side by side, in one scale, seen across the last one's longest axis."""
    axes = _axes(sample_points(shown[-1][0], 2000))
    titles = ["a ball", "with marks of the muscle", "fitted", "the muscle"]
    points = np.concatenate([s.vertices @ axes for s, _ in shown])
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    figure, panels = plt.subplots(2, 2, figsize=(9.0, 4.2), layout="constrained")
    for number, (ax, (surface, marks), title) in enumerate(zip(panels.flat, shown, titles, strict=True)):
        view = surface.moved(surface.vertices @ axes)
        normals = view.triangle_normals()
        corners = view.vertices[view.triangles]
        seen = np.flatnonzero(normals[:, 2] > 0)
        seen = seen[np.argsort(corners[seen, :, 2].mean(axis=1))]
        shade = 0.35 + 0.65 * np.abs(normals[seen] @ LIGHT)
        colours = np.outer(shade, (0.85, 0.45, 0.4) if number == 3 else (0.45, 0.65, 0.9))
        ax.add_collection(
            PolyCollection(
                list(corners[seen, :, :2]), facecolors=colours, edgecolors=(0, 0, 0, 0.4), linewidths=0.2
            )
        )
        if marks is not None:
            ax.scatter(*(marks @ axes).T[:2], s=1.5, c="k", zorder=3)
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        ax.set_axis_off()
        ax.set_title(title, fontsize=9)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _axes(points: Array) -> Array:
    """Principal axes (3, 3) in columns, the longest first, a rotation."""
    axes = np.linalg.eigh(np.cov(points.T))[1][:, ::-1]
    return axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("muscle", type=Path, help="closed surface: PLY, OBJ, STL")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--compare", action="store_true")
    options = parser.parse_args()
    muscle = read_surface(options.muscle, closed=True)
    (compare if options.compare else write_task)(muscle, options.folder)


if __name__ == "__main__":
    main()
