"""Contact that is never violated: logarithmic barriers between embedded surfaces, by the IPC Toolkit."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.fem.contact.collision_surface import (
    collision_filter,
    collision_mesh,
    generic_hessian,
    neighbours,
    new_collisions,
)
from handpipe.fem.patterns.growing_pattern import GrowingPattern
from handpipe.fem.potentials.potential import Potential, Sum
from handpipe.mesh.contact import crossings, ipctk
from handpipe.mesh.surfaces import Surface

RESERVE = 0.9  # share of a free step that is taken
REACH = 10.0  # mean edge lengths that no surface vertex moves beyond in one step: bounds the candidates
CANDIDATES_PER_FACE = 15  # with more of them from a swept step, a new search is cheaper than sorting them out
TIMES_COUNTED = 2.0  # pairs that see one place of two surfaces in contact: 0.5 to 7.3, by their meshes
FORESIGHT = 1.5  # pairs up to this many activation distances enter the Hessian's pattern in advance
STRETCH = 1e-3  # strain by which a stiffness is measured
DEVIATORIC = 0.7  # mean of |dev n| over directions


@dataclass(frozen=True)
class _Swept:
    """A straight motion of all surface vertices, free of collisions up to a fraction of it."""

    start: Array
    motion: Array
    fraction: float
    candidates: ipctk.Candidates

    def contains(self, positions: Array) -> bool:
        """Whether the motion passes through these positions before its free fraction ends."""
        change = positions - self.start
        squared = float(np.vdot(self.motion, self.motion))
        along = float(np.vdot(change, self.motion)) / squared if squared > 0 else 0.0
        rounding = 1e-13 * (1.0 + np.abs(self.start).max(initial=0.0))
        off = np.abs(change - along * self.motion).max(initial=0.0)
        return off <= rounding and -1e-12 <= along <= self.fraction * (1 + 1e-12)


@dataclass(frozen=True)
class CollidingPairs:
    """Which parts of a collision surface may collide.

    Parameters
    ----------
    self_contact : bool
        Whether the surface may collide with itself.
    allowed : CollisionFilter, optional
        Further filter on pairs of vertices; obstacle vertices are numbered after surface vertices.
    rest : array (n, 3), optional
        Vertex positions in mm from which areas and neighbours are computed; by default the positions at the
        start.
    """

    self_contact: bool = True
    allowed: ipctk.CollisionFilter | None = None
    rest: Array | None = None


class Barrier:
    """Barrier energy of a collision surface p = W x, against itself and against an obstacle.

    Energy: sum over pairs of A kappa d_hat b((d / d_hat)^2) / 2, b(s) = -(s - 1)^2 ln s, with A the rest area
    that a pair stands for. The Hessian is exact. The value is infinite at intersecting positions; steps are
    bounded by continuous collision detection. Parallel surfaces at distance d press on one another by about
    kappa `pressure_ratio(d / d_hat)`: from a fifth to four times as much, depending on how their meshes meet.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        W, which takes vertex positions (n, 3) to surface vertices (k, 3).
    triangles : integer array (t, 3)
        Triangles of the surface vertices.
    x : array (n, 3)
        Vertex positions in mm at the start, where no surfaces may intersect.
    distance : float
        Activation distance d_hat in mm, below the edge length: beyond it there is no force. Parts that are
        nearer than it at rest, and few edges apart, count as neighbours and never collide.
    stiffness : float
        kappa in kPa, best near Young's modulus of the softer body (`barrier_stiffness`): stresses of its size
        then lead to a gap of d_hat / 2.
    obstacle : tuple of array (o, 3) and integer array (s, 3), optional
        Vertices in mm and triangles that do not move in a solve; `advance` moves them between solves.
    pairs : CollidingPairs, optional
        Which further parts never collide; by default none.

    Raises
    ------
    InputError
        If the surfaces intersect at the start.

    References
    ----------
    Li et al. 2023, Convergent incremental potential contact.
    """

    one_sided = True

    def __init__(
        self,
        operator: sp.spmatrix | sp.sparray,
        triangles: IntArray,
        x: Array,
        distance: float,
        stiffness: float,
        *,
        obstacle: tuple[Array, IntArray] | None = None,
        pairs: CollidingPairs | None = None,
    ) -> None:
        pairs = pairs or CollidingPairs()
        self._narrow = sp.csr_matrix(operator)
        count = self._narrow.shape[0]
        faces = np.asarray(triangles)
        self.obstacle = np.zeros((0, 3))
        if obstacle is not None:
            self.obstacle = np.array(obstacle[0], dtype=float)
            faces = np.concatenate([faces, np.asarray(obstacle[1]) + count])
        below = sp.csr_matrix((len(self.obstacle), self._narrow.shape[1]))
        self._operator = sp.vstack([self._narrow, below], format="csr")
        self._wide = sp.kron(self._operator, sp.eye(3), format="csr")
        self.distance, self.stiffness = distance, stiffness
        self._mesh = collision_mesh(self.positions(x if pairs.rest is None else pairs.rest), faces, count)
        colliding = collision_filter(count, len(self.obstacle), pairs.self_contact)
        if pairs.allowed is not None:
            colliding = colliding & pairs.allowed
        self._mesh.can_collide = colliding
        self._neighbours = neighbours(self._mesh, count, distance)
        if len(self._neighbours.pairs):
            self._mesh.can_collide = colliding & self._neighbours.filter()
        self._edge = float(ipctk.mean_edge_length(self.positions(x), self.positions(x), self._mesh.edges)[0])
        self._potential = ipctk.BarrierPotential(distance, stiffness / TIMES_COUNTED, True)
        self._pattern = GrowingPattern()
        self._swept: _Swept | None = None
        self._last: tuple[Array, ipctk.NormalCollisions] | None = None
        self._held: ipctk.NormalCollisions | None = None  # whose pairs the pattern has
        if self.intersects(x):
            raise InputError("barrier", "x", "the surfaces intersect at the start", "Separate them first")

    def positions(self, x: Array) -> Array:
        """Surface and obstacle vertices (k + o, 3) in Fortran order."""
        return np.asfortranarray(np.concatenate([self._narrow @ x, self.obstacle]))

    def with_obstacle(self, vertices: Array) -> Barrier:
        """The same barrier with the obstacle's vertices (o, 3) at another place."""
        other = self._twin()
        other.obstacle = np.array(vertices, dtype=float)
        return other

    def reaching(self, distance: float) -> Barrier:
        """The same barrier with another activation distance in mm; pairs that never collide stay the same."""
        other = self._twin()
        other.distance = distance
        other._potential = ipctk.BarrierPotential(distance, self.stiffness / TIMES_COUNTED, True)
        other._pattern = GrowingPattern()
        return other

    def _twin(self) -> Barrier:
        """A copy without anything computed at earlier positions."""
        other = copy.copy(self)
        other._swept = other._last = other._held = None
        return other

    def intersects(self, x: Array) -> bool:
        """Whether an edge cuts a triangle that may collide: the final check of a finished shape.

        An edge that came into a triangle where only neighbours are, which never collide, does not count.
        """
        return self._cuts(self.positions(x))

    def gap(self, x: Array) -> float:
        """Least distance in mm between parts that may collide; infinite beyond the activation distance."""
        positions, collisions = self._collisions(x)
        return float(np.sqrt(collisions.compute_minimum_distance(self._mesh, positions)))

    def value(self, x: Array) -> float:
        """Energy in microjoules; infinite where a surface intersects itself or the obstacle."""
        positions, collisions = self._collisions(x)
        if not self._is_free(positions):
            return np.inf
        return float(self._potential(collisions, self._mesh, positions))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force; zero beyond `distance`."""
        return self._operator.T @ self._surface_gradient(x)

    def force_sizes(self, x: Array) -> Array:
        """Size (n,) in mN of the force on each vertex."""
        return np.asarray(np.sqrt((self.gradient(x) ** 2).sum(axis=1)))

    def reached(self) -> BoolArray:
        """Mask (n,) of the vertices that carry the surface."""
        return np.bincount(self._narrow.indices, minlength=self._narrow.shape[1]) > 0

    def surface_forces(self, x: Array) -> Array:
        """Forces (k, 3) in mN on the surface's own vertices."""
        return -self._surface_gradient(x)[: self._narrow.shape[0]]

    def obstacle_forces(self, x: Array) -> Array:
        """Forces (o, 3) in mN of the surface on the obstacle's vertices."""
        return -self._surface_gradient(x)[self._narrow.shape[0] :]

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm; with `project`, made semidefinite pair by pair."""
        positions, collisions = self._collisions(x)
        if self._held is not collisions:
            # Plain and projected matrices have zeros in different places: neither shows the whole pattern.
            structure = self._reduce(generic_hessian(self._potential, collisions, self._mesh, positions))
            self._pattern.hold(structure, lambda: self._foreseen(positions))
            self._held = collisions
        return self._pattern.fit(self._reduce(self._local_hessian(x, project)))

    def convex_hessian(self, x: Array) -> sp.csr_matrix:
        """Hessian without each pair's negative eigenvalues, in a sparsity pattern of its own.

        It takes a third of the work where contacts change so often that no pattern would last.
        """
        return self._reduce(self._local_hessian(x, True))

    def max_step(self, x: Array, step: Array) -> float:
        """Fraction of the step that stays free of collisions, with a tenth in reserve."""
        start = self.positions(x)
        return self._sweep(start, self.positions(x + step) - start)

    def advance(self, x: Array, step: Array, vertices: Array) -> tuple[float, Barrier]:
        """Move body by `step` (n, 3) and obstacle to `vertices` (o, 3) together, as far as is free.

        Returns the fraction of both motions that was made, and the barrier with the obstacle there: itself
        where there is none.
        """
        if not len(self.obstacle):
            return self.max_step(x, step), self
        start, moved = self.positions(x), self.with_obstacle(vertices)
        fraction = self._sweep(start, moved.positions(x + step) - start)
        return fraction, self.with_obstacle(self.obstacle + fraction * (moved.obstacle - self.obstacle))

    def drag(self, x: Array, motion: Array) -> Array:
        """Change (n, 3) in mN of the gradient, to first order, as the obstacle moves by `motion` (o, 3)."""
        everything = np.zeros((self._operator.shape[0], 3))
        everything[self._narrow.shape[0] :] = motion
        return self._operator.T @ (self._local_hessian(x, True) @ everything.ravel()).reshape(-1, 3)

    def _surface_gradient(self, x: Array) -> Array:
        positions, collisions = self._collisions(x)
        return self._potential.gradient(collisions, self._mesh, positions).reshape(-1, 3)

    def _local_hessian(self, x: Array, project: bool) -> sp.csc_matrix:
        positions, collisions = self._collisions(x)
        method = ipctk.PSDProjectionMethod.CLAMP if project else ipctk.PSDProjectionMethod.NONE
        return self._potential.hessian(collisions, self._mesh, positions, method)

    def _reduce(self, local: sp.csc_matrix) -> sp.csr_matrix:
        """Second derivative by x of that by surface and obstacle vertices."""
        return sp.csr_matrix(self._wide.T @ sp.csr_matrix(local) @ self._wide)

    def _foreseen(self, positions: Array) -> sp.csr_matrix:
        """A matrix whose pattern has the pairs that may soon be active."""
        further = FORESIGHT * self.distance
        collisions = new_collisions()
        collisions.build(self._mesh, positions, further, 0.0, ipctk.LBVH())
        potential = ipctk.BarrierPotential(further, self.stiffness / TIMES_COUNTED, True)
        return self._reduce(generic_hessian(potential, collisions, self._mesh, positions))

    def _sweep(self, start: Array, motion: Array) -> float:
        """Free fraction of a motion of all vertices; its candidates are kept for the line search."""
        longest = float(np.sqrt((motion**2).sum(axis=1).max(initial=0.0)))
        bound = min(1.0, REACH * self._edge / max(longest, 1e-300))
        end = np.asfortranarray(start + bound * motion)
        candidates = ipctk.Candidates()
        candidates.build(self._mesh, start, end, 0.5 * self.distance, ipctk.LBVH())
        # Additive CCD: the interval search of the default takes seconds where faces meet in parallel.
        ccd = ipctk.AdditiveCCD()
        free = float(candidates.compute_collision_free_stepsize(self._mesh, start, end, 0.0, ccd))
        fraction = bound if free >= 1.0 else RESERVE * free * bound
        if self._is_free(start):
            self._swept = _Swept(start, motion, fraction, candidates)
        return fraction

    def _is_free(self, positions: Array) -> bool:
        """Whether nothing intersects: known from the last swept step, else computed."""
        if self._swept is not None and self._swept.contains(positions):
            return True
        return not self._cuts(positions)

    def _cuts(self, positions: Array) -> bool:
        if not ipctk.has_intersections(self._mesh, positions, ipctk.LBVH()):
            return False
        if not len(self._neighbours.pairs):
            return True
        surface = Surface(positions, self._mesh.faces)
        found = crossings(surface, self._mesh.can_collide)
        edges, triangles = surface.edges()[found[:, 0]], surface.triangles[found[:, 1]]
        through = self._neighbours.let_through(edges, triangles)
        return not (len(found) and through.all())  # where the two tests differ, the toolkit's counts

    def _collisions(self, x: Array) -> tuple[Array, ipctk.NormalCollisions]:
        positions = self.positions(x)
        if self._last is None or not np.array_equal(self._last[0], positions):
            collisions = new_collisions()
            swept = self._swept
            few = swept is not None and len(swept.candidates) < CANDIDATES_PER_FACE * self._mesh.num_faces
            if swept is not None and few and swept.contains(positions):
                collisions.build(swept.candidates, self._mesh, positions, self.distance)
            else:
                collisions.build(self._mesh, positions, self.distance, 0.0, ipctk.LBVH())
            self._last = positions, collisions
        return self._last


class ConvexBarrier:
    """A barrier with a Hessian that is always projected: contact directions change little within a step.

    Parameters
    ----------
    barrier : Barrier
        The barrier.
    """

    def __init__(self, barrier: Barrier) -> None:
        self.barrier = barrier
        self.value, self.gradient, self.max_step = barrier.value, barrier.gradient, barrier.max_step

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm without negative eigenvalues of pairs; `project` is ignored."""
        return self.barrier.convex_hessian(x)


def pressure_ratio(gap: Array | float) -> Array:
    """Pressure between parallel surfaces over the barrier's stiffness, at gaps in activation distances.

    -2 u b'(u^2) of the barrier's b; meshes make it larger or smaller, see `Barrier`.
    """
    u = np.minimum(np.asarray(gap, dtype=float), 1.0)
    s = u**2
    return 2 * u * (2 * (s - 1) * np.log(s) + (s - 1) ** 2 / s)


def barrier_stiffness(
    potentials: Sequence[Potential], operator: sp.spmatrix | sp.sparray, triangles: IntArray, x: Array
) -> float:
    """Pressure in kPa with which bodies resist shear: about their Young's modulus, for a barrier's stiffness.

    Taken from the gradients of `potentials` at x (n, 3) under three small stretches that keep volume:
    the mean traction of a homogeneous body on a surface of area A is 2 mu epsilon times the mean of
    |dev n| over directions, 0.7.
    """
    epsilon, energy = STRETCH, Sum(potentials)
    centre = x.mean(axis=0)
    points = sp.csr_matrix(operator) @ x
    a, b, c = (points[np.asarray(triangles)[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    total = 0.0
    for axis in range(3):
        stretch = np.full(3, -0.5 * epsilon)
        stretch[axis] = epsilon
        change = (x - centre) * stretch
        traction = energy.gradient(x + change) - energy.gradient(x - change)
        total += 0.5 * np.linalg.norm(traction, axis=1).sum()
    return float(3 * total / (3 * 2 * DEVIATORIC * epsilon * area))
