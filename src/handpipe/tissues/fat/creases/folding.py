"""Where the skin folds in the range of motion: where it is pressed together on the surface."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, RigidTransform
from handpipe.fem.linear import factorise
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import cotangent_laplacian, mass_lumped
from handpipe.skeleton.posing import blend, bone_weights
from handpipe.skeleton.rig import Rig

SMOOTH = 3.0  # mm over which the skin's bone weights are diffused
SHARES = (0.5, 1.0)  # of each limit at which the skin is looked at
FOLDING = 0.6  # least stretch below which skin folds


def folding_vertices(skin: Surface, rig: Rig) -> BoolArray:
    """Vertices of the neutral skin that are pressed together in some joint's range of motion.

    The skin is blended between the bones, one angle at a time at half and all of its limits. It folds where a
    triangle is shorter than 0.6 of its neutral length in some direction.

    Parameters
    ----------
    skin : Surface
        Closed neutral skin in mm, n vertices.
    rig : Rig
        The bone rig.

    Returns
    -------
    array (n,) of bool
        Mask of the vertices.
    """
    weights = _smooth_weights(skin, rig)
    least = np.ones(len(skin.triangles))
    for bones in _limits(rig):
        moved = blend(skin.vertices, weights, {bone: bones[bone] for bone in rig.surfaces})
        least = np.minimum(least, _least_stretch(skin, moved))
    return _mean_at_vertices(skin, least) < FOLDING


def _smooth_weights(skin: Surface, rig: Rig) -> Array:
    """Bone weights (n, n_bones) by distance to the nearest bone and its neighbours, diffused on the surface.

    Without the others: else a finger's skin would follow the finger beside it through the air.
    """
    near = bone_weights(skin.vertices, rig.surfaces)
    near *= _jointed(rig)[near.argmax(axis=1)]
    mass = sparse.diags(mass_lumped(skin.vertices, skin.triangles))
    matrix = mass + SMOOTH**2 * cotangent_laplacian(skin.vertices, skin.triangles)
    weights = factorise(matrix.tocsr()).solve(mass @ (near / near.sum(axis=1, keepdims=True)))
    weights = np.maximum(weights, 0.0)
    return weights / weights.sum(axis=1, keepdims=True)


def _jointed(rig: Rig) -> BoolArray:
    """Which bones (n_bones, n_bones) are one or share a joint, in the order of the rig's surfaces."""
    names = list(rig.surfaces)
    ends = np.array([(names.index(j.parent), names.index(j.child)) for j in rig.joints])
    jointed = np.eye(len(names), dtype=bool)
    jointed[ends[:, 0], ends[:, 1]] = jointed[ends[:, 1], ends[:, 0]] = True
    return jointed


def _limits(rig: Rig) -> list[dict[str, RigidTransform]]:
    """Bones with one angle at a share of a limit, all others at zero."""
    rest = dict.fromkeys(rig.angle_names, 0.0)
    return [
        rig.bone_transforms(rest | {name: share * limit})
        for name, limits in rig.limits.items()
        for limit in limits
        for share in SHARES
    ]


def _least_stretch(skin: Surface, moved: Array) -> Array:
    """Smallest principal stretch (k,) of the triangles."""
    before, after = (x[skin.triangles[:, 1:]] - x[skin.triangles[:, :1]] for x in (skin.vertices, moved))
    metric = np.linalg.solve(before @ before.transpose(0, 2, 1), after @ after.transpose(0, 2, 1))
    squares = np.linalg.eigvals(metric).real
    return np.sqrt(np.maximum(squares.min(axis=1), 0.0))


def _mean_at_vertices(skin: Surface, values: Array) -> Array:
    """Means (n,) of the values (k,) of the triangles around each vertex, by area."""
    areas, corners = skin.triangle_areas(), skin.triangles.ravel()
    sums = [np.bincount(corners, np.repeat(v, 3), len(skin.vertices)) for v in (areas * values, areas)]
    return sums[0] / sums[1]
