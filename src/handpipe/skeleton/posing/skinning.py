"""Smooth blends of bone transforms: starting guesses for what the tissues then compute."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.fem.linear import factorise
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh


def bone_weights(points: Array, bones: Mapping[str, Surface], power: float = 3.0) -> Array:
    """Weights of points by inverse powers of their distance to each bone.

    The distance has 1 mm added, so that weights stay smooth across a bone's surface.

    Parameters
    ----------
    points : array (n, 3)
        Points in the neutral frame, mm.
    bones : mapping of str to Surface
        Neutral bone surfaces, mm.
    power : float
        Exponent of the distance.

    Returns
    -------
    array (n, n_bones)
        Weights in the order of `bones`; rows sum to one.
    """
    distances = np.stack([np.maximum(Distance(s).signed(points)[0], 0.0) for s in bones.values()], axis=1)
    weights = (distances + 1.0) ** -power
    return weights / weights.sum(axis=1, keepdims=True)


def smoothed_weights(mesh: TetMesh, bones: Mapping[str, Surface], reach: float = 10.0) -> Array:
    """Bone weights at a mesh's vertices, diffused so that blends of bent joints invert no tet.

    Parameters
    ----------
    mesh : TetMesh
        Neutral mesh, mm.
    bones : mapping of str to Surface
        Neutral bone surfaces, mm.
    reach : float
        Strength of the diffusion: roughly the square of its length in edges.

    Returns
    -------
    array (n, n_bones)
        Weights in the order of `bones`; rows sum to one.
    """
    n = len(mesh.vertices)
    corners = [(a, b) for a in range(4) for b in range(a)]
    ends = np.concatenate([mesh.tets[:, pair] for pair in corners])
    graph = sparse.coo_matrix((np.ones(len(ends)), ends.T), shape=(n, n)).tocsr()
    graph = ((graph + graph.T) > 0).astype(float)
    degrees = np.asarray(graph.sum(axis=1)).ravel()
    laplacian = sparse.diags(degrees) - graph
    matrix = sparse.identity(n) + (reach / degrees.mean()) * laplacian
    weights = factorise(matrix.tocsr()).solve(bone_weights(mesh.vertices, bones))
    return weights / weights.sum(axis=1, keepdims=True)


def _dual_quaternion(transform: RigidTransform) -> tuple[Array, Array]:
    """Real and dual part, each (4,) as x, y, z, w."""
    q = Rotation.from_matrix(transform.rotation).as_quat()
    v, w, t = q[:3], q[3], transform.translation
    return q, 0.5 * np.append(w * t + np.cross(t, v), -t @ v)


def blend(points: Array, weights: Array, transforms: Mapping[str, RigidTransform]) -> Array:
    """Points moved by blends of transforms.

    Parameters
    ----------
    points : array (n, 3)
        Neutral points, mm.
    weights : array (n, n_transforms)
        Weight of each transform at each point.
    transforms : mapping of str to RigidTransform
        Transforms in the order of the weights' columns.

    Returns
    -------
    array (n, 3)
        Moved points, mm.
    """
    turns, translation = blended(weights, transforms)
    return turns.apply(points) + translation


def blend_linearly(points: Array, weights: Array, transforms: Mapping[str, RigidTransform]) -> Array:
    """Points moved by the weighted means of transforms: linear blend skinning.

    Bends of tens of degrees make points at the joint collapse towards it. `blend` does not.

    Parameters
    ----------
    points : array (n, 3)
        Neutral points, mm.
    weights : array (n, n_transforms)
        Weight of each transform at each point; rows sum to one.
    transforms : mapping of str to RigidTransform
        Transforms in the order of the weights' columns.

    Returns
    -------
    array (n, 3)
        Moved points, mm.
    """
    moved = np.stack([transform(points) for transform in transforms.values()])
    return np.einsum("nt,tni->ni", weights, moved)


def blended(weights: Array, transforms: Mapping[str, RigidTransform]) -> tuple[Rotation, Array]:
    """Rotations and translations of dual-quaternion blends.

    Dual quaternions turn about joints without the collapse of linear blends. Each motion has two dual
    quaternions of opposite sign. Each point takes those on the side of its own bone's: a finger's joints
    together turn by more than half a turn, the joint next to the point does not.

    Parameters
    ----------
    weights : array (n, n_transforms)
        Weight of each transform at each point.
    transforms : mapping of str to RigidTransform
        Transforms in the order of the weights' columns.

    Returns
    -------
    rotations : Rotation
        The n rotations.
    translations : array (n, 3)
        Translations after the rotations, mm.

    References
    ----------
    Kavan et al. 2008.
    """
    parts = [_dual_quaternion(t) for t in transforms.values()]
    real, dual = (np.stack(p) for p in zip(*parts, strict=True))
    sides = np.where(real @ real.T < 0, -1.0, 1.0)
    signed = weights * sides[weights.argmax(axis=1)]
    r, d = signed @ real, signed @ dual
    norm = np.linalg.norm(r, axis=1, keepdims=True)
    r, d = r / norm, d / norm
    translation = 2.0 * (r[:, 3:] * d[:, :3] - d[:, 3:] * r[:, :3] + np.cross(r[:, :3], d[:, :3]))
    return Rotation.from_quat(r), translation
