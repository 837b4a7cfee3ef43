"""A scan with what it shows beside its shape: texture coordinates and images, or colours of its vertices."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from handpipe.core import Array, InputError, IntArray

BEGINNING = 2**20  # bytes of a scan in which its materials or images are named
MAP = "map_kd"  # in a file of materials: the image of the diffuse colour
REMEDY = "Put it beside the scan, or remove its name there"


@dataclass(frozen=True)
class ScanPart:
    """The triangles of a scan with one material.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm; a vertex stands once for each place that it has in the image.
    triangles : array (m, 3)
        Vertex indices.
    places : array (n, 2), optional
        Place of each vertex in the image, from its lower left corner: right and up, from 0 to 1.
    image : PIL image, optional
        The image.
    colours : array (n, 3) of uint8, optional
        sRGB of each vertex, where there is no image.
    """

    vertices: Array
    triangles: IntArray
    places: Array | None = None
    image: Image.Image | None = None
    colours: NDArray[np.uint8] | None = None


def texture_files(path: str | Path) -> list[Path]:
    """The files beside a scan that it names: materials and images.

    Parameters
    ----------
    path : path
        PLY, OBJ or STL file.

    Returns
    -------
    list of Path
        Existing files.

    Raises
    ------
    InputError
        Where one does not exist.
    """
    path = Path(path)
    with path.open("rb") as file:
        lines = file.read(BEGINNING).decode("utf-8", errors="replace").splitlines()
    if path.suffix.lower() == ".ply":
        named = [found[1] for line in lines if (found := re.match(r"comment TextureFile\s+(.+)", line))]
        return [_beside(path, name) for name in named]
    if path.suffix.lower() != ".obj":
        return []
    materials = [_beside(path, line.split(None, 1)[1]) for line in lines if line.startswith("mtllib ")]
    return [file for material in materials for file in (material, *_images(material))]


def read_textured(path: str | Path) -> list[ScanPart]:
    """Read a scan's triangles by their materials.

    Parameters
    ----------
    path : path
        PLY, OBJ or STL file, in mm.

    Returns
    -------
    list of ScanPart
        A part of each material.

    Raises
    ------
    InputError
        Where a file that it names is missing, or cannot be read.
    """
    texture_files(path)
    try:
        scene = trimesh.load_scene(str(path), process=False)
    except Exception as error:  # of many kinds, by what is wrong with the file
        raise InputError(path, "content", f"cannot be read ({error})", "Export the scan again") from error
    meshes = [mesh for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    return [_part(path, mesh) for mesh in meshes if len(mesh.faces)]


def _images(material: Path) -> list[Path]:
    """The images that a file of materials names."""
    lines = material.read_text(encoding="utf-8", errors="replace").splitlines()
    words = [line.split(None, 1) for line in lines]
    named = [given[1].strip() for given in words if len(given) == 2 and given[0].lower() == MAP]
    # Options stand before the name, as in "-s 1 1 1 skin.png".
    return [_beside(material, name.split()[-1] if name.startswith("-") else name) for name in named]


def _beside(path: Path, name: str) -> Path:
    found = path.parent / name.strip()
    if not found.is_file():
        raise InputError(path, "texture", f"names {name.strip()}, which does not exist", REMEDY)
    return found


def _part(path: str | Path, mesh: trimesh.Trimesh) -> ScanPart:
    vertices, triangles = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    look: Any = mesh.visual
    if look.kind == "vertex":
        return ScanPart(vertices, triangles, colours=np.array(look.vertex_colors[:, :3], np.uint8))
    image, places = getattr(getattr(look, "material", None), "image", None), getattr(look, "uv", None)
    # Where a material has no image, the library makes one up, which has no format.
    if image is None or image.format is None or places is None:
        return ScanPart(vertices, triangles)
    try:
        image.load()
    except OSError as error:
        raise InputError(path, "texture", f"cannot be read ({error})", "Export the image again") from error
    # Some programs give each corner a place of its own, though most of them are equal.
    both, same = np.unique(np.column_stack([vertices, places]), axis=0, return_inverse=True)
    return ScanPart(both[:, :3], same.ravel()[triangles], both[:, 3:], image)
