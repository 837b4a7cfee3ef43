"""Nails: rigid, carried by their bones with a pose-space correction (Zheng 2022 §7.2)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface

SHARE, LEVER = 1e-3, 25.0  # 1 and mm^2: resistance to motion, of the vertices' weight; to turns, over that
STILL, STILL_TURN = 1e-4, 1e-5  # mm and rad


def nail_vertices(skin: Surface, nail: Surface, tolerance: float) -> IntArray:
    """Skin vertices of a nail.

    Parameters
    ----------
    skin : Surface
        Skin in mm.
    nail : Surface
        Patch of the nail in mm.
    tolerance : float
        Distance in mm from the patch under which a vertex belongs to the nail.

    Returns
    -------
    array (k,) of int
        Vertex ids.
    """
    return np.flatnonzero(Distance(nail).closest(skin.vertices)[0] < tolerance)


def on_skin(patch: Surface, skin: Surface) -> Surface:
    """A patch of a nail laid on the skin, each vertex at its closest place.

    Parameters
    ----------
    patch, skin : Surface
        The patch is near the skin.

    Returns
    -------
    Surface
        The same triangles.
    """
    return patch.moved(Distance(skin).closest(patch.vertices)[2])


def fit_correction(
    points: Array, bone: RigidTransform, scan: Surface, reach: float = 3.0, iterations: int = 20
) -> RigidTransform:
    """Correction of a nail's motion that lays its neutral points on a scan.

    Point-to-plane registration. A smooth patch leaves tangential sliding free: a weak pull to no correction
    determines it.

    Parameters
    ----------
    points : array (n, 3)
        Neutral points of the nail in mm.
    bone : RigidTransform
        Transform of the nail's bone from neutral.
    scan : Surface
        Scan in mm.
    reach : float
        Distance in mm from the scan under which points count.
    iterations : int
        Largest number of iterations.

    Returns
    -------
    RigidTransform
        Correction in the bone's neutral frame: the nail's transform from neutral is `bone @ correction`.
    """
    distance = Distance(scan)
    correction = RigidTransform.identity()
    centre = points.mean(axis=0)
    for _ in range(iterations):
        moved = (bone @ correction)(points)
        gap, _, closest, normals = distance.signed(moved)
        near = np.abs(gap) < reach
        arm = moved - bone(centre)
        rows = np.concatenate([np.cross(arm, normals), normals], axis=1)[near]
        residual = np.einsum("ni,ni->n", closest - moved, normals)[near]
        weight = SHARE * near.sum()
        step = np.linalg.solve(rows.T @ rows + weight * np.diag([LEVER] * 3 + [1.0] * 3), rows.T @ residual)
        turn = RigidTransform.about(bone(centre), Rotation.from_rotvec(step[:3]).as_matrix())
        increment = RigidTransform(turn.rotation, turn.translation + step[3:])
        correction = bone.inverse() @ increment @ bone @ correction
        if np.linalg.norm(step[3:]) < STILL and np.linalg.norm(step[:3]) < STILL_TURN:
            break
    return correction


def as_vector(correction: RigidTransform, centre: Array) -> Array:
    """The correction as the pose space interpolates it.

    Parameters
    ----------
    correction : RigidTransform
        Correction in the bone's neutral frame.
    centre : array (3,)
        Neutral centre of the nail in mm.

    Returns
    -------
    array (6,)
        Rotation vector (rad) and shift of the centre (mm).
    """
    return np.concatenate([correction.rotation_vector(), correction(centre) - centre])


def from_vector(vector: Array, centre: Array) -> RigidTransform:
    """Inverse of `as_vector`."""
    rotation = Rotation.from_rotvec(vector[:3]).as_matrix()
    return RigidTransform(rotation, centre + vector[3:] - rotation @ centre)
