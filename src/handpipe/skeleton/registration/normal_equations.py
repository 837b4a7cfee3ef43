"""Least squares for a small rigid motion from distances to tangent planes, robust, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform, robust

PATCHES, LEAST_PATCH = 20, 10  # of a bone's surface, some millimetres wide each; vertices of one at least
UNTOLD = np.array([1.0, 10.0])  # rad and mm
FINEST = 0.01  # mm; distances below this are not told apart
MOST_ALIKE = 0.95  # correlation of neighbours' errors
STEPS = 25  # along a surface, within which errors are correlated


@dataclass(frozen=True)
class Rows:
    """Linear equations jacobian (n, 6) @ (omega, t) = distance (n,) in mm."""

    jacobian: Array
    distance: Array

    @staticmethod
    def build(points: Array, normals: Array, distance: Array, centre: Array) -> Rows:
        """Points (n, 3) are to move along unit normals (n, 3) by distance (n,), turning about centre (3,)."""
        return Rows(np.hstack([np.cross(points - centre, normals), normals]), distance)

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        """The equations of all parts, one below the other."""
        return Rows(np.vstack([p.jacobian for p in parts]), np.concatenate([p.distance for p in parts]))


def robust_weights(distance: Array) -> Array:
    """Tukey's biweights (n,) in [0, 1], zero beyond about five standard deviations of the bulk."""
    deviation = max(robust.NORMAL * float(np.median(np.abs(distance))), FINEST)
    return np.maximum(1 - (distance / (robust.TUKEY * deviation)) ** 2, 0) ** 2


def solve(rows: Rows, weights: Array) -> Array:
    """Small motion (6,) of least weighted squares; what the rows leave undetermined stays zero."""
    matrix, right = _normal(rows, weights)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    scaled = matrix / np.outer(scale, scale) + 1e-6 * np.eye(len(matrix))
    return np.linalg.solve(scaled, right / scale) / scale


def covariance(rows: Rows, weights: Array, edges: IntArray, points: Array) -> Array:
    """Covariance (6, 6) of the solution when the rows belong to mesh vertices joined by edges (e, 2).

    The larger, in every direction, of two estimates. One takes the residuals as noise that neighbours share
    (`alike`). The other (`patch_covariance`) takes what whole patches of the surface, by the places of the
    points (n, 3), pull the solution to: errors that are alike over millimetres, as where thick slices or a
    thin shell move the surface of a segmentation. A direction that no row determines has the deviation
    `UNTOLD`.
    """
    matrix, _ = _normal(rows, weights)
    residual = rows.distance * np.sqrt(weights)
    independent = weights.sum() / alike(residual, edges)
    spare = max(independent - len(matrix), 1.0)
    scatter = (residual**2).sum() / weights.sum() * independent / spare * alike(residual, edges)
    scatter = max(float(scatter), FINEST**4)
    shared = np.asarray(np.linalg.inv(matrix / scatter + np.diag(np.repeat(UNTOLD, 3) ** -2.0)), float)
    return larger(shared, patch_covariance(rows, weights, points, shared / scatter))


def patch_covariance(rows: Rows, weights: Array, points: Array, inverse: Array) -> Array:
    """Covariance from the spread of patches' pulls.

    The estimate is robust to any correlation within a patch (cluster-robust). It is zero where a mesh is too
    coarse for patches.

    Parameters
    ----------
    rows : Rows
        The equations.
    weights : array (n,)
        Their weights.
    points : array (n, 3)
        Places of the rows, which decide their patches, mm.
    inverse : array (6, 6)
        Inverse of the normal matrix.

    Returns
    -------
    array (6, 6)
        Covariance of (omega, t) in rad and mm.

    References
    ----------
    Liang and Zeger 1986.
    """
    count = min(PATCHES, len(points) // LEAST_PATCH)
    if count <= 2 * len(inverse):
        return np.zeros_like(inverse)
    _, patch = kmeans2(points, count, minit="++", seed=0)
    pulls = np.zeros((count, len(inverse)))
    np.add.at(pulls, patch, (weights * rows.distance)[:, None] * rows.jacobian)
    spread = pulls.T @ pulls * count / (count - len(inverse))
    return np.asarray(inverse @ spread @ inverse, float)


def larger(a: Array, b: Array) -> Array:
    """Covariance (n, n) that is at least a in every direction, and at least b; a positive definite."""
    root = np.linalg.cholesky(a)
    back = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(back @ b @ back.T)
    return np.asarray(root @ (vectors * np.maximum(values, 1.0)) @ vectors.T @ root.T, float)


def alike(residual: Array, edges: IntArray) -> float:
    """How many of a mesh's vertices count as one: errors (n,) of those joined by edges (e, 2) are alike.

    Smooth errors' correlation falls off with the square of the distance: r at one step is r^(k^2) at k steps
    in either direction of the surface. n vertices count as n / (sum over k of r^(k^2))^2 independent ones.
    """
    product = (residual[edges[:, 0]] * residual[edges[:, 1]]).mean()
    correlation = np.clip(product / max((residual**2).mean(), 1e-30), 0.0, MOST_ALIKE)
    steps = np.arange(1, STEPS)
    return float((1 + 2 * (correlation ** (steps**2)).sum()) ** 2)


def moved(transform: RigidTransform, step: Array, middle: Array) -> RigidTransform:
    """The transform followed by a small motion (6,): rotation about its image of `middle`, translation."""
    turn = RigidTransform.about(transform(middle), Rotation.from_rotvec(step[:3]).as_matrix())
    return RigidTransform(np.eye(3), step[3:]) @ turn @ transform


def _normal(rows: Rows, weights: Array) -> tuple[Array, Array]:
    weighted = rows.jacobian * weights[:, None]
    return weighted.T @ rows.jacobian, weighted.T @ rows.distance
