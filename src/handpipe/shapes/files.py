"""Template meshes, pairs of points and fitted organs as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import meshio
import numpy as np
from numpy.typing import NDArray

from handpipe import artifacts, metrics
from handpipe.errors import InputError
from handpipe.fem import plasticity
from handpipe.imaging.markers import read_landmarks
from handpipe.mesh.surface import Surface, write_surface
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.shapes.marks import Pairs

if TYPE_CHECKING:
    from handpipe.shapes.organ import OrganFit

Array = NDArray[np.float64]

METRES = 1.0  # mm; a body that is smaller is given in metres


def read_template(path: str | Path) -> TetMesh:
    """Read a tet mesh in mm (VTK, VTU, Gmsh, MEDIT... by its suffix), without vertices that no tet uses.

    Raises `InputError` where the file is missing, is no mesh or has no tets, where some tets are inverted or
    flat, and where it looks like metres.
    """
    if not Path(path).exists():
        raise InputError(path, "file", "does not exist", "Check the path")
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio exits or raises anything on a malformed file
        raise InputError(path, "content", f"cannot be read ({error})", "Export the mesh again") from error
    blocks = [block.data for block in mesh.cells if block.type == "tetra"]
    if sum(len(block) for block in blocks) == 0:
        raise InputError(path, "tets", "there are none", "Fill the surface with tetrahedra first")
    used, tets = np.unique(np.concatenate(blocks), return_inverse=True)
    found = TetMesh(mesh.points[used, :3], tets.reshape(-1, 4))
    extent = float(np.ptp(found.vertices, axis=0).max())
    if extent < METRES:
        raise InputError(path, "units", f"looks like metres (extent {extent:.3g})", "Give mm: scale by 1000")
    if (found.volumes() < 0).all():
        found = TetMesh(found.vertices, found.tets[:, [0, 2, 1, 3]])
    return found.checked(path)


def read_pairs(template: str | Path, image: str | Path) -> Pairs:
    """Pairs of points by label, from two `.mrk.json` files: on the template, and in the image.

    Raises `InputError` where a label of one file is missing in the other.
    """
    points, targets = read_landmarks(template), read_landmarks(image)
    for path, missing in ((image, points.keys() - targets), (template, targets.keys() - points)):
        if missing:
            problem = f"lacks {', '.join(sorted(missing))}"
            raise InputError(path, "labels", problem, "Give both files the same labels")
    labels = list(points)
    return Pairs(np.array([points[a] for a in labels]), np.array([targets[a] for a in labels]))


def write_fit(folder: str | Path, fit: OrganFit, inputs: list[str | Path]) -> None:
    """Write fitted.vtu, surface.ply, quality.json and fit.h5 (mesh, strains, kept marks, doubtful
    attachments, every step).
    """
    folder = Path(folder)
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
