"""Contact that is never violated: logarithmic barriers between embedded surfaces, by the IPC Toolkit."""

from __future__ import annotations

import ipctk
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from handpipe.errors import InputError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Barrier:
    """Barrier energy of a collision surface p = W x (k, 3), against itself and against fixed obstacles.

    It is infinite at contact and zero beyond `distance` mm (well below the edge length, or a surface feels
    its own neighbours); `stiffness` in mN/mm scales it. `patches` (k,) forbids contact within a patch where
    `self_contact` is off. `obstacle` is (vertices, triangles), given at the place it has in this solve.
    Start without intersection: `InputError` otherwise. Steps are bounded by continuous collision detection.
    """

    def __init__(
        self,
        operator: sp.spmatrix | sp.sparray,
        triangles: IntArray,
        x: Array,
        distance: float,
        stiffness: float,
        *,
        obstacle: tuple[Array, IntArray] | None = None,
        patches: IntArray | None = None,
        self_contact: bool = True,
    ) -> None:
        surface = sp.csr_matrix(operator)
        faces, fixed = np.asarray(triangles), np.zeros((0, 3))
        if obstacle is not None:
            fixed = np.asarray(obstacle[0], dtype=float)
            faces = np.concatenate([faces, np.asarray(obstacle[1]) + surface.shape[0]])
        self._fixed = fixed
        self._operator = sp.vstack([surface, sp.csr_matrix((len(fixed), surface.shape[1]))], format="csr")
        self._wide = sp.kron(self._operator, sp.eye(3), format="csr")
        self._narrow = surface
        self._distance = distance
        positions = self.positions(x)
        faces = np.asfortranarray(faces, dtype=np.int32)
        self._mesh = ipctk.CollisionMesh(positions, ipctk.edges(faces), faces)
        self._mesh.can_collide = _filter(surface.shape[0], len(fixed), patches, self_contact)
        self._potential = ipctk.BarrierPotential(distance, stiffness)
        self._last: tuple[Array, ipctk.NormalCollisions] | None = None
        if ipctk.has_intersections(self._mesh, positions):
            raise InputError("barrier", "x", "the surfaces intersect at the start", "Separate them first")

    def positions(self, x: Array) -> Array:
        """Surface and obstacle vertices (k + o, 3) in Fortran order."""
        return np.asfortranarray(np.concatenate([self._narrow @ x, self._fixed]))

    def gap(self, x: Array) -> float:
        """Least distance in mm between parts that may collide, where below the barrier's; else infinite."""
        positions, collisions = self._collisions(x)
        return float(np.sqrt(collisions.compute_minimum_distance(self._mesh, positions)))

    def value(self, x: Array) -> float:
        positions, collisions = self._collisions(x)
        return float(self._potential(collisions, self._mesh, positions))

    def gradient(self, x: Array) -> Array:
        positions, collisions = self._collisions(x)
        forces = self._potential.gradient(collisions, self._mesh, positions)
        return self._operator.T @ forces.reshape(-1, 3)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        positions, collisions = self._collisions(x)
        method = ipctk.PSDProjectionMethod.CLAMP if project else ipctk.PSDProjectionMethod.NONE
        local = self._potential.hessian(collisions, self._mesh, positions, method)
        return sp.csr_matrix(self._wide.T @ local @ self._wide)

    def max_step(self, x: Array, step: Array) -> float:
        """Fraction of the step that stays free of collisions, with a tenth in reserve."""
        start, end = self.positions(x), self.positions(x + step)
        # Additive CCD: the interval search of the default takes seconds where faces meet in parallel.
        ccd = ipctk.AdditiveCCD()
        free = ipctk.compute_collision_free_stepsize(self._mesh, start, end, narrow_phase_ccd=ccd)
        return 1.0 if free >= 1.0 else 0.9 * float(free)

    def _collisions(self, x: Array) -> tuple[Array, ipctk.NormalCollisions]:
        positions = self.positions(x)
        if self._last is None or not np.array_equal(self._last[0], positions):
            collisions = ipctk.NormalCollisions()
            collisions.build(self._mesh, positions, self._distance)
            self._last = positions, collisions
        return self._last


def _filter(count: int, fixed: int, patches: IntArray | None, self_contact: bool) -> ipctk.CollisionFilter:
    """Which pairs of vertices may collide: never two of the obstacle."""
    ids = np.zeros(count, dtype=np.int32) if patches is None else np.asarray(patches, dtype=np.int32)
    allowed = ipctk.make_static_obstacle_filter(count)
    if not self_contact:
        everyone = np.concatenate([ids, np.full(fixed, ids.max() + 1, dtype=np.int32)])
        allowed = allowed & ipctk.make_vertex_patches_filter(everyone)
    return allowed
