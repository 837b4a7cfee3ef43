"""Filling a closed surface with tetrahedra."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from handpipe.core import HandpipeError, InputError, IntArray
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface, component_labels, concatenate, require_closed
from handpipe.mesh.tets.tetrahedra import TetMesh

LIBRARIES = (
    "libgomp1 libglu1-mesa libgl1 libxrender1 libxcursor1 libxfixes3 "
    "libxext6 libxft2 libxinerama1 libx11-6 libfontconfig1"
)
CUTS = ("intersect", "PLC Error", "Invalid boundary mesh", "No elements in volume")  # gmsh, of such surfaces
VOLUME_TOLERANCE = 0.02  # of the wanted volume


def tetrahedralise(surface: Surface, edge_length: float, *, keep_surface: bool = True) -> TetMesh:
    """Tetrahedra that fill a closed surface, graded in size towards its triangles.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm. One of its parts faces outwards; parts that face inwards are the walls of holes.
    edge_length : float
        Edge length in mm far from the surface.
    keep_surface : bool
        Whether the boundary is the surface itself, its vertices the first ones of the mesh, in order. If not,
        the surface is first remeshed to `edge_length`.

    Returns
    -------
    TetMesh
        Vertices in mm, tets of positive volume.

    Raises
    ------
    InputError
        Where the surface is open, cuts or touches itself, or has not exactly one part that faces outwards.
    HandpipeError
        Where gmsh is not installed, cannot load a library, or fails for another reason.
    """
    require_closed(surface, "tetrahedralise")
    if not keep_surface:
        surface = concatenate([remesh(part, edge_length) for part in surface.components()])
    mesh = _run_gmsh(surface, _shells(surface), edge_length).checked("gmsh")
    wanted, found = surface.volume(), float(mesh.volumes().sum())
    if abs(found - wanted) > VOLUME_TOLERANCE * wanted:
        problem = f"encloses {wanted:.4g} mm^3, its tetrahedra {found:.4g} mm^3"
        raise InputError("tetrahedralise", "surface", problem, "Repair the surface: it overlaps itself")
    return mesh


def _shells(surface: Surface) -> IntArray:
    """The shell of each triangle (k,): 0 for the outer one, which faces outwards, then the holes."""
    labels = component_labels(surface.triangles)
    parts = [
        Surface(surface.vertices, surface.triangles[labels == i]).compact() for i in range(labels.max() + 1)
    ]
    outer = [i for i, part in enumerate(parts) if part.volume() > 0]
    if len(outer) != 1:
        problem = f"has {len(outer)} closed parts that face outwards, not one"
        raise InputError(
            "tetrahedralise", "surface", problem, "Mesh its parts apart; holes must face inwards"
        )
    order = [outer[0], *(i for i in range(len(parts)) if i != outer[0])]
    return np.argsort(order)[labels]


def _run_gmsh(surface: Surface, shell: IntArray, edge_length: float) -> TetMesh:
    if importlib.util.find_spec("gmsh") is None:
        raise HandpipeError("gmsh is not installed: pip install gmsh, or install handpipe[gmsh]")
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "surface.npz"), Path(folder, "mesh.npz")
        np.savez(
            source,
            vertices=surface.vertices,
            triangles=surface.triangles,
            shell=shell,
            edge_length=edge_length,
        )
        command = [sys.executable, "-m", "handpipe.mesh.generation.gmsh_process", str(source), str(target)]
        run = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
        if run.returncode != 0 or not target.exists():
            _explain(run.stdout + run.stderr)
        with np.load(target) as result:
            return TetMesh(result["vertices"], result["tets"])


def _explain(log: str) -> None:
    """Raise the error that explains a failed run of gmsh."""
    tail = "\n".join(log.strip().splitlines()[-20:])
    if "OSError" in log and ".so" in log:
        raise HandpipeError(f"gmsh cannot load a library. On Debian: apt-get install {LIBRARIES}\n{tail}")
    cuts = [line for line in log.splitlines() if any(words in line for words in CUTS)]
    if cuts:
        problem = f"cuts or touches itself, or its triangles overlap (gmsh: {cuts[-1].strip()})"
        remedy = "Repair it with handpipe.mesh.generation.repair"
        raise InputError("tetrahedralise", "surface", problem, remedy)
    raise HandpipeError(f"gmsh failed:\n{tail}")
