"""Least squares for a small rigid motion from distances to tangent planes, robust, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handpipe.mesh.rigid import RigidTransform

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
FINEST = 0.01  # mm; distances below this are not told apart


@dataclass(frozen=True)
class Rows:
    """Linear equations jacobian (n, 6) @ (omega, t) = distance (n,) in mm."""

    jacobian: Array
    distance: Array

    @staticmethod
    def of(points: Array, normals: Array, distance: Array, centre: Array) -> Rows:
        """Points (n, 3) are to move along unit normals (n, 3) by distance (n,), turning about centre (3,)."""
        return Rows(np.hstack([np.cross(points - centre, normals), normals]), distance)

    @staticmethod
    def joined(parts: Sequence[Rows]) -> Rows:
        return Rows(np.vstack([p.jacobian for p in parts]), np.concatenate([p.distance for p in parts]))


def robust_weights(distance: Array) -> Array:
    """Tukey's biweights (n,) in [0, 1], zero beyond about five standard deviations of the bulk."""
    deviation = max(1.4826 * float(np.median(np.abs(distance))), FINEST)
    return np.maximum(1 - (distance / (4.685 * deviation)) ** 2, 0) ** 2


def solve(rows: Rows, weights: Array) -> Array:
    """Small motion (6,) of least weighted squares; what the rows leave undetermined stays zero."""
    matrix, right = _normal(rows, weights)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    scaled = matrix / np.outer(scale, scale) + 1e-6 * np.eye(len(matrix))
    return np.linalg.solve(scaled, right / scale) / scale


def covariance(rows: Rows, weights: Array, edges: IntArray) -> Array:
    """Covariance (6, 6) of the solution when the rows belong to mesh vertices joined by edges (e, 2)."""
    matrix, _ = _normal(rows, weights)
    residual = rows.distance * np.sqrt(weights)
    variance = (residual**2).sum() / max(weights.sum() - len(matrix), 1.0)
    return variance * alike(residual, edges) * np.linalg.pinv(matrix, rcond=1e-14)


def alike(residual: Array, edges: IntArray) -> float:
    """How many of a mesh's vertices count as one: errors (n,) of those joined by edges (e, 2) are alike.

    Smooth errors' correlation falls off with the square of the distance: r at one step is r^(k^2) at k steps
    in either direction of the surface. n vertices count as n / (sum over k of r^(k^2))^2 independent ones.
    """
    product = (residual[edges[:, 0]] * residual[edges[:, 1]]).mean()
    correlation = np.clip(product / max((residual**2).mean(), 1e-30), 0.0, 0.95)
    steps = np.arange(1, 25)
    return float((1 + 2 * (correlation ** (steps**2)).sum()) ** 2)


def moved(transform: RigidTransform, step: Array, middle: Array) -> RigidTransform:
    """The transform followed by a small motion (6,): rotation about its image of `middle`, translation."""
    turn = RigidTransform.about(transform(middle), Rotation.from_rotvec(step[:3]).as_matrix())
    return RigidTransform(np.eye(3), step[3:]) @ turn @ transform


def _normal(rows: Rows, weights: Array) -> tuple[Array, Array]:
    weighted = rows.jacobian * weights[:, None]
    return weighted.T @ rows.jacobian, weighted.T @ rows.distance
