"""Whether arrays are a mesh of linear tets at all, before anything is computed on them."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, InputError, IntArray

FACES = np.array([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)])


def check_tets(vertices: Array, tets: IntArray) -> None:
    """Raise `InputError` unless tets (m, 4) of vertices (n, 3) are distinct and at most two share a face."""
    _check_arrays(vertices, tets)
    corners = np.sort(tets, axis=1)
    order = np.lexsort(corners.T)
    equal = (corners[order[1:]] == corners[order[:-1]]).all(axis=1)
    if equal.any():
        at = int(np.argmax(equal))
        first, second = sorted((int(order[at]), int(order[at + 1])))
        problem = f"tets {first} and {second} have the same four vertices ({int(equal.sum())} such tets)"
        raise InputError("tetrahedra", "tets", problem, "Keep one of them: two would be twice as stiff")
    faces = corners[:, FACES].reshape(-1, 3)
    keys = (faces[:, 0] * len(vertices) + faces[:, 1]) * len(vertices) + faces[:, 2]
    order = np.argsort(keys)
    third = keys[order[2:]] == keys[order[:-2]]
    if third.any():
        first = int(np.argmax(third))
        shared = order[first : first + 3]
        owners = ", ".join(str(i) for i in np.sort(shared // 4))
        face = ", ".join(str(v) for v in faces[shared[0]])
        problem = f"the face of vertices {face} belongs to three tets or more ({owners})"
        raise InputError("tetrahedra", "tets", problem, "Mesh the body anew: tets overlap there")


def _check_arrays(vertices: Array, tets: IntArray) -> None:
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        problem = f"has shape {vertices.shape}, not (n, 3)"
        raise InputError("tetrahedra", "vertices", problem, "Give three coordinates in mm a vertex")
    if tets.ndim != 2 or tets.shape[1] != 4:
        quadratic = tets.ndim == 2 and tets.shape[1] == 10
        remedy = "Give the corners of linear tets (m, 4)"
        if quadratic:
            remedy = "These are quadratic tets: give their first four nodes, the corners"
        raise InputError("tetrahedra", "tets", f"has shape {tets.shape}, not (m, 4)", remedy)
    if len(tets) and (tets.min() < 0 or tets.max() >= len(vertices)):
        worst = int(np.argmax((tets < 0).any(axis=1) | (tets >= len(vertices)).any(axis=1)))
        problem = f"tet {worst} has a vertex outside 0 to {len(vertices) - 1}"
        raise InputError("tetrahedra", "tets", problem, "Number vertices from zero")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        problem = f"vertex {int(np.argmax(bad))} is not finite"
        raise InputError("tetrahedra", "vertices", problem, "Give finite coordinates in mm")
