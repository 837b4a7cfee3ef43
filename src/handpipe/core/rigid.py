"""Rigid transforms of points, X -> R X + x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core.arrays import Array

SERIES = 1e-4  # rad, below which a series takes the place of the formula: its next terms are below 1e-9


@dataclass(frozen=True)
class RigidTransform:
    """The map X -> rotation @ X + translation.

    Parameters
    ----------
    rotation : array (3, 3)
        Rotation matrix.
    translation : array (3,)
        Translation in mm.
    """

    rotation: Array
    translation: Array

    @staticmethod
    def identity() -> RigidTransform:
        """The transform that leaves every point where it is."""
        return RigidTransform(np.eye(3), np.zeros(3))

    @staticmethod
    def about(centre: Array, rotation: Array) -> RigidTransform:
        """Rotation (3, 3) about a fixed centre (3,).

        Examples
        --------
        >>> half_turn = RigidTransform.about(np.array([1.0, 0.0, 0.0]), np.diag([-1.0, -1.0, 1.0]))
        >>> half_turn(np.array([[3.0, 0.0, 5.0]])).tolist()
        [[-1.0, 0.0, 5.0]]
        """
        return RigidTransform(rotation, centre - rotation @ centre)

    @staticmethod
    def fit(source: Array, target: Array, weights: Array | None = None) -> RigidTransform:
        """The rigid transform with the least sum of squared distances between points and targets (Kabsch).

        Parameters
        ----------
        source, target : array (n, 3)
            Points in mm and the places to which they belong.
        weights : array (n,), optional
            Weights of the squared distances; all equal by default.

        Returns
        -------
        RigidTransform
        """
        w = np.ones(len(source)) if weights is None else weights
        a, b = w @ source / w.sum(), w @ target / w.sum()
        u, _, vt = np.linalg.svd((target - b).T @ ((source - a) * w[:, None]))
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
        rotation = u @ flip @ vt
        return RigidTransform(rotation, b - rotation @ a)

    @property
    def matrix(self) -> Array:
        """The matrix (3, 4) of rotation and translation side by side."""
        return np.column_stack([self.rotation, self.translation])

    def __call__(self, points: Array) -> Array:
        """Transformed points, of the shape (3,) or (n, 3) of `points`, in mm."""
        return points @ self.rotation.T + self.translation

    def __matmul__(self, other: RigidTransform) -> RigidTransform:
        """The composition self(other(X)): `other` is applied first."""
        return RigidTransform(self.rotation @ other.rotation, self(other.translation))

    def inverse(self) -> RigidTransform:
        """The transform that takes images back to their points."""
        return RigidTransform(self.rotation.T, -self.rotation.T @ self.translation)

    def rotation_vector(self) -> Array:
        """Axis times angle (3,) in rad, angle in [0, pi]."""
        return Rotation.from_matrix(self.rotation).as_rotvec()

    def angle_to(self, other: RigidTransform) -> float:
        """Angle in rad of the rotation between two transforms."""
        return float(Rotation.from_matrix(self.rotation.T @ other.rotation).magnitude())


def left_jacobian(vector: Array) -> Array:
    """The matrix that takes the rate of a rotation vector to the angular velocity of its rotation.

    Parameters
    ----------
    vector : array (3,)
        Rotation vector in rad.

    Returns
    -------
    array (3, 3)
    """
    angle = float(np.linalg.norm(vector))
    x = np.cross(np.eye(3), vector)  # x @ y is the cross product of vector and y
    if angle < SERIES:
        return np.eye(3) + x / 2 + x @ x / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * x + (angle - np.sin(angle)) / angle**3 * x @ x
