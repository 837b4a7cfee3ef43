"""Reads source anatomy: its folder, and its meshes with repairs."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import trimesh

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.mesh.generation import repair
from handpipe.mesh.surfaces import Surface

log = logging.getLogger(__name__)


def folder_of(dataset: Dataset) -> Path:
    """Folder of a dataset's source anatomy.

    Parameters
    ----------
    dataset : Dataset
        Generated subject that is made from real anatomy.

    Returns
    -------
    path
        The existing folder.

    Raises
    ------
    InputError
        If the dataset names no folder or the folder does not exist.
    """
    if dataset.anatomy is None or not dataset.anatomy.exists():
        problem = "is not given" if dataset.anatomy is None else f"{dataset.anatomy} does not exist"
        raise InputError(dataset.name, "anatomy", problem, "Give the folder of the source anatomy")
    return dataset.anatomy


def require(path: Path) -> Path:
    """The path of a source file; `InputError` where there is none."""
    if not path.exists():
        raise InputError(path, "file", "is absent", "Put the anatomy where the dataset's `anatomy` says")
    return path


def read_mesh(path: Path) -> Surface:
    """A source mesh as it is; `InputError` where the file is absent."""
    mesh = trimesh.load_mesh(require(path), process=False)
    return Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def repair_mesh(mesh: Surface, name: str) -> Surface:
    """A closed surface that faces outwards; the log says what was repaired."""
    mesh, said = repair(mesh)
    for sentence in said:
        log.info("%s: %s", name, sentence)
    return mesh


def subdivided(mesh: Surface) -> Surface:
    """The smooth surface that a coarse mesh stands for (Loop), one round."""
    smooth = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).subdivide_loop(iterations=1)
    return Surface(np.asarray(smooth.vertices, dtype=float), np.asarray(smooth.faces, dtype=np.int64))
