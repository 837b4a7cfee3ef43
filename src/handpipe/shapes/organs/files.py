"""Template meshes, pairs of points and fitted organs as files."""

from __future__ import annotations

import tempfile
from pathlib import Path

import meshio
import numpy as np

from handpipe.core import InputError, artifacts, metrics
from handpipe.fem.elements import plasticity
from handpipe.imaging.evidence import read_landmarks
from handpipe.mesh.files import write_surface
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh, read_tets
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.organs.organ import OrganFit


def read_template(path: str | Path) -> TetMesh:
    """Read a tet mesh in mm (VTK, VTU, Gmsh, MEDIT... by its suffix), as `read_tets` does."""
    return read_tets(path)


def read_pairs(template: str | Path, image: str | Path) -> Pairs:
    """Pairs of points by label, from two `.mrk.json` files: on the template, and in the image.

    Raises
    ------
    InputError
        If a label of one file is missing in the other.
    """
    points, targets = read_landmarks(template), read_landmarks(image)
    for path, missing in ((image, points.keys() - targets), (template, targets.keys() - points)):
        if missing:
            problem = f"lacks {', '.join(sorted(missing))}"
            raise InputError(path, "labels", problem, "Give both files the same labels")
    labels = list(points)
    return Pairs(np.array([points[a] for a in labels]), np.array([targets[a] for a in labels]))


def write_fit(folder: str | Path, fit: OrganFit, inputs: list[str | Path]) -> None:
    """Write fitted.vtu, surface.ply, quality.json and fit.h5.

    All of them are written, or none where one cannot be written. The file fit.h5 has the mesh, strains, kept
    marks, doubtful attachments, and every step.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".fit-", dir=folder) as name:
        _write_all(Path(name), fit, inputs)
        for file in sorted(Path(name).iterdir()):
            file.replace(folder / file.name)


def _write_all(folder: Path, fit: OrganFit, inputs: list[str | Path]) -> None:
    stretches = plasticity.eigenvalues(fit.strains)
    cells = {"plastic_strain": [fit.strains], "principal_strains": [stretches]}
    mesh = meshio.Mesh(fit.mesh.vertices, [("tetra", fit.mesh.tets)], cell_data=cells)
    with artifacts.atomic(folder / "fitted.vtu") as temporary:
        meshio.write(temporary, mesh)
    write_surface(folder / "surface.ply", Surface(fit.mesh.vertices, fit.mesh.boundary_faces()[0]).compact())
    metrics.write(folder / "quality.json", fit.quality)
    artifacts.write(
        folder / "fit.h5",
        {
            "vertices": fit.mesh.vertices,
            "tets": fit.mesh.tets,
            "rest_vertices": fit.rest.vertices,
            "template_vertices": fit.carried,
            "strains": fit.strains,
            "kept": fit.kept.astype(np.uint8),
            "doubtful": fit.doubtful.astype(np.uint8),
            "record": fit.table(),
        },
        kind="organ",
        units={"vertices": "mm", "rest_vertices": "mm", "template_vertices": "mm", "strains": "1"},
        inputs=inputs,
    )
