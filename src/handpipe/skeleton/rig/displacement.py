"""How far a bone's points are from where they are wanted, as a few numbers, and their derivatives."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig.twists import MovingBone

Moments = tuple[Array, Array]  # centroid (3,) and square root (3, 3) of the covariance of a bone's vertices


def moments(surface: Surface) -> Moments:
    """Of a surface's vertices, in mm."""
    centroid = surface.vertices.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(surface.vertices.T, bias=True))
    return centroid, vectors * np.sqrt(np.maximum(values, 0))


def displacement(found: RigidTransform, wanted: RigidTransform, of_bone: Moments) -> Array:
    """Numbers (12,) in mm whose squares sum to the mean square of a bone's displacement.

    It takes the bone's vertices from where one transform puts them to where the other does.
    """
    centroid, root = of_bone
    turned = (found.rotation - wanted.rotation) @ root
    return np.concatenate([turned.ravel(), found(centroid) - wanted(centroid)])


def displacement_rates(bone: MovingBone, of_bone: Moments) -> Array:
    """Derivatives (12, n) of `displacement` by the rig's angles, for a bone where it has come to."""
    centroid, root = of_bone
    turned = np.cross(bone.angular[:, None, :], (bone.transform.rotation @ root).T)  # by angle, column, row
    flat = turned.transpose(0, 2, 1).reshape(len(bone.angular), 9)
    return np.hstack([flat, bone.velocities(centroid)]).T
