"""Springs and one-sided penalties on embedded points: fixed, sliding and contact constraints (Zheng 2022 §6).

All Hessians are exact. Where targets and planes move, `moved` gives the same constraint at the new place;
within a solve they do not move.
"""

from __future__ import annotations

from typing import Self, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from handpipe.core import Array, InputError, unit_vectors
from handpipe.fem.contact.one_sided import penalty
from handpipe.fem.contact.points import PointPotential, dyads, per_point

Operator: TypeAlias = sp.spmatrix | sp.sparray


class Attachment(PointPotential):
    """Fixed constraint: springs s/2 |p - y|^2 from points p to targets y.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        Takes vertex positions (n, 3) to points (k, 3).
    targets : array (k, 3)
        Targets y in mm.
    stiffness : float or array (k,)
        Stiffness s in mN/mm, zero or more.

    Raises
    ------
    InputError
        If targets are misshapen or not finite, or a stiffness is misshapen, negative or not finite.

    References
    ----------
    Wang 2021 Eq. F.3.
    """

    quadratic = True
    each = ("targets", "stiffness")

    def __init__(self, operator: Operator, targets: Array, stiffness: ArrayLike) -> None:
        super().__init__(operator)
        self.targets = _vectors(targets, self.count, "targets")
        self.stiffness = per_point(stiffness, self.count, "stiffness")

    def moved(self, targets: Array) -> Attachment:
        """The same springs to other targets (k, 3)."""
        other = self.twin()
        other.targets = _vectors(targets, self.count, "targets")
        return other

    def energies(self, points: Array) -> Array:
        """Energy (k,) in microjoules of each spring."""
        return 0.5 * self.stiffness * ((points - self.targets) ** 2).sum(axis=1)

    def forces(self, points: Array) -> Array:
        """Gradient (k, 3) in mN of each spring's energy."""
        return self.stiffness[:, None] * (points - self.targets)

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (k, 3, 3) in mN/mm: the stiffness times the identity."""
        return self.stiffness[:, None, None] * np.eye(3)


class Sliding(PointPotential):
    """Sliding constraint: springs s/2 ((p - q) . n)^2 from points p to planes through q with normals n.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        Takes vertex positions (n, 3) to points (k, 3).
    points : array (k, 3)
        Points q of the planes in mm.
    normals : array (k, 3)
        Normals n of the planes, of any length but zero.
    stiffness : float or array (k,)
        Stiffness s in mN/mm, zero or more.

    Raises
    ------
    InputError
        If an array is misshapen or not finite, a normal is zero, or a stiffness is negative.

    References
    ----------
    Zheng 2022 §6.
    """

    quadratic = True
    each = ("origins", "normals", "stiffness")

    def __init__(self, operator: Operator, points: Array, normals: Array, stiffness: ArrayLike) -> None:
        super().__init__(operator)
        self.origins = _vectors(points, self.count, "points")
        self.normals = _unit_normals(_vectors(normals, self.count, "normals"))
        self.stiffness = per_point(stiffness, self.count, "stiffness")

    def moved(self, points: Array, normals: Array) -> Self:
        """The same constraint with planes through other points (k, 3), with other normals (k, 3)."""
        other = self.twin()
        other.origins = _vectors(points, self.count, "points")
        other.normals = _unit_normals(_vectors(normals, self.count, "normals"))
        other._hessian = None
        return other

    def heights(self, points: Array) -> Array:
        """Signed distances (k,) of points from their planes."""
        return np.einsum("ij,ij->i", points - self.origins, self.normals)

    def energies(self, points: Array) -> Array:
        """Energy (k,) in microjoules of each point's distance from its plane."""
        return 0.5 * self.stiffness * self.heights(points) ** 2

    def forces(self, points: Array) -> Array:
        """Gradient (k, 3) in mN of each point's energy, along the plane's normal."""
        return (self.stiffness * self.heights(points))[:, None] * self.normals

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (k, 3, 3) in mN/mm: s n n^T, constant and semidefinite."""
        return self.stiffness[:, None, None] * dyads(self.normals)


class Contact(Sliding):
    """Contact constraint: points are pushed out of the half-spaces below their planes.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        Takes vertex positions (n, 3) to points (k, 3).
    points : array (k, 3)
        Points of the planes in mm.
    normals : array (k, 3)
        Normals of the planes out of the obstacle, of any length but zero.
    stiffness : float or array (k,)
        Stiffness in mN/mm at depths of `onset` or more, zero or more.
    onset : float
        Depth in mm over which the stiffness rises from zero (see `penalty`); zero or less: a sudden rise.

    Raises
    ------
    InputError
        If an array is misshapen or not finite, a normal is zero, or a stiffness is negative.

    References
    ----------
    Zheng 2022 §6.
    """

    one_sided = True
    quadratic = False

    def __init__(
        self, operator: Operator, points: Array, normals: Array, stiffness: ArrayLike, onset: float = 0.05
    ) -> None:
        super().__init__(operator, points, normals, stiffness)
        self.onset = onset

    def energies(self, points: Array) -> Array:
        """Energy (k,) in microjoules of each point; zero above its plane."""
        return self.stiffness * penalty(-self.heights(points), self.onset)[0]

    def forces(self, points: Array) -> Array:
        """Gradient (k, 3) in mN of each point's energy, along the plane's normal; zero above the plane."""
        return -(self.stiffness * penalty(-self.heights(points), self.onset)[1])[:, None] * self.normals

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (k, 3, 3) in mN/mm; semidefinite, since the penalty is convex."""
        second = self.stiffness * penalty(-self.heights(points), self.onset)[2]
        return second[:, None, None] * dyads(self.normals)


def left_deep(gaps: Array, normals: Array, bite: float) -> Array:
    """Offsets of contact planes that take a limited depth away from points.

    Planes that pushed points out of a great depth all at once would push away from where the other surface
    was.

    Parameters
    ----------
    gaps : array (k,)
        Signed distances of points from the surface in mm, negative inside.
    normals : array (k, 3)
        Unit normals of the planes.
    bite : float
        Largest depth in mm to take away at once.

    Returns
    -------
    array (k, 3)
        Offsets in mm along the normals, inwards for points deeper than `bite`, else zero.
    """
    return np.minimum(gaps + bite, 0.0)[:, None] * normals


def _vectors(array: Array, count: int, name: str) -> Array:
    out = np.ascontiguousarray(array, dtype=float)
    if out.shape != (count, 3):
        raise InputError(
            "constraint", name, f"has shape {out.shape}, not ({count}, 3)", "Give one row a point"
        )
    bad = ~np.isfinite(out).all(axis=1)
    if bad.any():
        problem = f"row {int(np.argmax(bad))} is not finite"
        raise InputError("constraint", name, problem, "Give finite vectors")
    return out


def _unit_normals(vectors: Array) -> Array:
    """Normals of length 1; `InputError` for a zero vector."""
    if np.any(np.linalg.norm(vectors, axis=1) == 0):
        raise InputError("constraint", "normals", "has a zero vector", "Give unit normals")
    return unit_vectors(vectors)
