"""Templates of bones to be placed: a rod that is computed, the shipped hand's bones, and a person's own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from handpipe.core import InputError
from handpipe.mesh.files import SURFACE_SUFFIXES, read_surface
from handpipe.mesh.surfaces import Surface

ROD = "rod"
AROUND, ALONG = 20, 24  # vertices of a ring of the rod, and its rings
WAIST = 0.55  # radius of the rod's middle over that of its ends
SLENDER = 0.1  # largest radius of the rod over its length
KNOB = 0.14  # share of the rod's length that a rounded end takes
Library = Mapping[str, Surface]  # by name


def read_library(folders: list[Path], bones: Path) -> dict[str, Surface]:
    """The templates that bones may name.

    Parameters
    ----------
    folders : list of Path
        Folders of closed surfaces, PLY, STL or OBJ; a file's name is the template's.
    bones : Path
        Folder of the shipped hand's bones.

    Returns
    -------
    dict of str to Surface
        The rod, the shipped bones, and those of the folders, which take precedence.

    Raises
    ------
    InputError
        For a folder without surfaces, and wrong files.
    """
    found = {ROD: rod()}
    for folder in (bones, *folders):
        inside = folder.iterdir() if folder.is_dir() else ()
        files = sorted(p for p in inside if p.suffix.lower() in SURFACE_SUFFIXES)
        if not files:
            remedy = f"Name a folder of files {', '.join(SURFACE_SUFFIXES)}"
            raise InputError(folder, "library", "has no surface", remedy)
        found |= {path.stem: read_surface(path, closed=True) for path in files}
    return found


def rod() -> Surface:
    """A long bone of unit length along x: a shaft with a waist between rounded ends."""
    t = 0.5 * (1 - np.cos(np.linspace(0, np.pi, ALONG + 2)[1:-1]))  # rings are dense at the ends
    shaft = WAIST + (1 - WAIST) * (2 * t - 1) ** 2
    nearest = np.clip(np.minimum(t, 1 - t) / KNOB, 0, 1)
    radii = SLENDER * shaft * np.sqrt(1 - (1 - nearest) ** 2)
    turns = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = np.stack(
        [
            np.repeat(t[:, None], AROUND, 1),
            radii[:, None] * np.cos(turns),
            radii[:, None] * np.sin(turns),
        ],
        axis=-1,
    )
    vertices = np.vstack([rings.reshape(-1, 3), [[0.0, 0, 0], [1.0, 0, 0]]])
    first, last = len(vertices) - 2, len(vertices) - 1
    i = np.arange(AROUND)
    j = (i + 1) % AROUND
    low = (np.arange(ALONG - 1) * AROUND)[:, None]
    a, b, c, d = (x.ravel() for x in (low + i, low + j, low + AROUND + i, low + AROUND + j))
    end = (ALONG - 1) * AROUND
    triangles = np.vstack(
        [
            np.column_stack([a, b, c]),
            np.column_stack([b, d, c]),
            np.column_stack([np.full(AROUND, first), j, i]),
            np.column_stack([np.full(AROUND, last), end + i, end + j]),
        ]
    )
    surface = Surface(vertices, triangles)
    return surface if surface.volume() > 0 else surface.flipped()
