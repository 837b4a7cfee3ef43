"""Files beside a surface that it names: materials, and images of them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from handpipe.core import InputError

BEGINNING = 2**20  # bytes of a surface in which its materials or images are named
ALL = ""  # name of the material of a PLY file, which has one image at most
MAP = "map_kd"  # in a file of materials: the image of the diffuse colour
REMEDY = "Put it beside the scan, or remove its name there"


def texture_files(path: str | Path) -> list[Path]:
    """The files beside a surface that it names: materials and images.

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
    return [*_materials(Path(path)), *images_of_materials(path).values()]


def images_of_materials(path: str | Path) -> dict[str, Path]:
    """The images that a surface names, by their materials.

    Parameters
    ----------
    path : path
        PLY, OBJ or STL file.

    Returns
    -------
    dict of str to Path
        Existing files; the image of a PLY file is that of `ALL`.

    Raises
    ------
    InputError
        Where a file does not exist.
    """
    path = Path(path)
    if path.suffix.lower() == ".ply":
        comments = (re.match(r"comment TextureFile\s+(.+)", line) for line in _beginning(path))
        first = next((found[1] for found in comments if found), None)
        return {} if first is None else {ALL: _beside(path, first)}
    return dict(pair for material in _materials(path) for pair in _images(material))


def _materials(path: Path) -> list[Path]:
    """The files of materials of an OBJ file."""
    if path.suffix.lower() != ".obj":
        return []
    return [_beside(path, line.split(None, 1)[1]) for line in _beginning(path) if line.startswith("mtllib ")]


def _beginning(path: Path) -> list[str]:
    with path.open("rb") as file:
        return file.read(BEGINNING).decode("utf-8", errors="replace").splitlines()


def _images(materials: Path) -> Iterator[tuple[str, Path]]:
    """Each material of a file and its image."""
    material = ALL
    for line in materials.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split(None, 1)
        if len(words) == 2 and words[0] == "newmtl":
            material = words[1].strip()
        elif len(words) == 2 and words[0].lower() == MAP:
            # Options stand before the name, as in "-s 1 1 1 skin.png".
            name = words[1].strip()
            yield material, _beside(materials, name.split()[-1] if name.startswith("-") else name)


def _beside(path: Path, name: str) -> Path:
    found = path.parent / name.strip()
    if not found.is_file():
        raise InputError(path, "texture", f"names {name.strip()}, which does not exist", REMEDY)
    return found
