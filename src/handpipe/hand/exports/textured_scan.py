"""A scan with what it shows beside its shape: texture coordinates and images, or colours of its vertices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from handpipe.core import Array, InputError, IntArray
from handpipe.mesh.files import ALL, images_of_materials


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
    images = {name: _image(file) for name, file in images_of_materials(path).items()}
    try:
        scene = trimesh.load_scene(str(path), process=False)
    except Exception as error:  # of many kinds, by what is wrong with the file
        raise InputError(path, "content", f"cannot be read ({error})", "Export the scan again") from error
    meshes = [mesh for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    return [_part(mesh, images) for mesh in meshes if len(mesh.faces)]


def _image(path: Path) -> Image.Image:
    """An image that a material names. The library of surfaces loses images with options, without a word."""
    try:
        image = Image.open(path)
        image.load()
    except OSError as error:
        raise InputError(path, "content", f"cannot be read ({error})", "Export the image again") from error
    return image


def _part(mesh: trimesh.Trimesh, images: Mapping[str, Image.Image]) -> ScanPart:
    vertices, triangles = np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int64)
    look: Any = mesh.visual
    if look.kind == "vertex":
        return ScanPart(vertices, triangles, colours=np.array(look.vertex_colors[:, :3], np.uint8))
    places, material = getattr(look, "uv", None), getattr(look, "material", None)
    image = images.get(getattr(material, "name", None) or ALL, images.get(ALL))
    if image is None or places is None:
        return ScanPart(vertices, triangles)
    # Some programs give each corner a place of its own, though most of them are equal.
    both, same = np.unique(np.column_stack([vertices, places]), axis=0, return_inverse=True)
    return ScanPart(both[:, :3], same.ravel()[triangles], both[:, 3:], image)
