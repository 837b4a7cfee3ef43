"""Bones as files in metres, which models of the skeleton in other programs share."""

from __future__ import annotations

from pathlib import Path

import trimesh

from handpipe.core import Array, atomic
from handpipe.skeleton.rig import Rig

MESHES = "meshes"
METRE = 1e-3  # m a mm
BONE_DENSITY = 1900.0  # kg/m³: of compact bone


def bone_meshes(rig: Rig) -> dict[str, trimesh.Trimesh]:
    """Neutral bones in m, of the density of bone."""
    found = {}
    for bone, surface in rig.surfaces.items():
        found[bone] = trimesh.Trimesh(surface.vertices * METRE, surface.triangles, process=False)
        found[bone].density = BONE_DENSITY
    return found


def solid(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """What has the mass of a bone: the bone, or its convex hull if its surface has holes."""
    if mesh.is_watertight and mesh.volume > 0:
        return mesh
    hull = mesh.convex_hull
    hull.density = BONE_DENSITY
    return hull


def write_bones(folder: Path, rig: Rig) -> dict[str, str]:
    """Write each neutral bone as STL in m.

    Parameters
    ----------
    folder : path
        Folder of the model; the bones are in `meshes` below it.
    rig : Rig
        Bones.

    Returns
    -------
    dict of str to str
        The file's path below the folder by bone.
    """
    (folder / MESHES).mkdir(parents=True, exist_ok=True)
    files = {}
    for bone, mesh in bone_meshes(rig).items():
        files[bone] = f"{MESHES}/{bone}.stl"
        with atomic(folder / files[bone]) as temporary:
            mesh.export(temporary, file_type="stl")
    return files


def numbers(*values: float | Array) -> str:
    """Numbers as XML attributes have them."""
    return " ".join(f"{float(value):.12g}" for value in values)
