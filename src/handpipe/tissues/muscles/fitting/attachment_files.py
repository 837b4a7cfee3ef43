"""Files that name the vertices of a template which are attached to each bone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import InputError, IntArray
from handpipe.mesh.surfaces import Surface

VERTEX_IDS = "Give {bone: [template vertex ids]}"  # the remedy for a malformed file of attachments


def read_attachments(path: str | Path, template: Surface) -> dict[str, IntArray]:
    """Ids of attached vertices by bone, from a JSON file {bone: [ids]}.

    The id of a vertex that no triangle uses, but that is at the place of one in use, becomes the id of the
    latter: seams have such vertices.

    Parameters
    ----------
    path : path
        JSON file.
    template : Surface
        The template whose vertices the file names.

    Returns
    -------
    dict of str to array (k,)
        Vertex ids of each bone, sorted.

    Raises
    ------
    InputError
        Where the file is malformed, or names vertices that the template lacks or does not use.
    """
    found = read_vertex_ids(path)
    for bone, ids in found.items():
        if len(ids) == 0 or ids.min() < 0 or ids.max() >= len(template.vertices):
            problem = f"has ids outside 0..{len(template.vertices) - 1}, or none"
            raise InputError(path, bone, problem, VERTEX_IDS)
        found[bone] = _in_use(path, bone, ids, template)
    return found


def read_vertex_ids(path: str | Path) -> dict[str, IntArray]:
    """Whole numbers by bone, from a JSON file {bone: [ids]}.

    Parameters
    ----------
    path : path
        JSON file.

    Returns
    -------
    dict of str to array (k,)
        Numbers of each bone, sorted, each once.

    Raises
    ------
    InputError
        Where the file cannot be read or is malformed.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8-sig"), object_pairs_hook=_no_key_twice)
        return {str(bone): _whole_numbers(ids) for bone, ids in content.items()}
    except (OSError, ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(path, "content", f"cannot be read ({error})", VERTEX_IDS) from error


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key stands twice")
    return found


def _whole_numbers(ids: Any) -> IntArray:
    found = np.asarray(ids)
    whole = np.unique(found.astype(np.int64))
    if found.ndim != 1 or found.dtype.kind not in "iuf" or not np.isin(found, whole).all():
        raise ValueError(f"{str(ids)[:40]} is no list of whole numbers")
    return whole


def _in_use(path: str | Path, bone: str, ids: IntArray, template: Surface) -> IntArray:
    """The ids, each of a vertex of some triangle."""
    used = np.unique(template.triangles)
    idle = np.setdiff1d(ids, used)
    if len(idle) == 0:
        return ids
    distances, nearest = cKDTree(template.vertices[used]).query(template.vertices[idle])
    if (distances > 0).any():
        stray = idle[distances > 0]
        problem = f"names {len(stray)} vertices that no triangle uses, the first is {stray[0]}"
        raise InputError(path, bone, problem, "Name vertices of the surface")
    return np.unique(np.concatenate([np.intersect1d(ids, used), used[nearest]]))
