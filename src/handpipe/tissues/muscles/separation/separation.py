"""Separation of the surfaces of one pose: stage 2 of Zheng 2022 §4.4.

Afterwards no muscle is inside another or inside a bone.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from handpipe.core import Array, BoolArray, ConvergenceError, IntArray, artifacts
from handpipe.fem.contact import Barrier, CollidingPairs, ConvexBarrier
from handpipe.fem.potentials import Potential
from handpipe.fem.solver import equilibrium
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import mass_lumped
from handpipe.tissues.muscles.separation.disjoint_start import body_pairs, disjoint_start
from handpipe.tissues.muscles.separation.overlap import Collider, collision_filter, depth, folds
from handpipe.tissues.muscles.separation.surface_energy import KeptVolumes, Plate, thin_plate, volume_gradient

log = logging.getLogger(__name__)

KIND = "separated-muscles"
BARRIER_STIFFNESS = 1.0  # mm of displacement whose pressure balances the barrier at half the clearance
BARRIER_RANGES = (8.0, 4.0, 2.0)  # ranges of the first barriers, times the clearance
PRESSURE_RANGE = 2.0  # longest range, times the clearance, at which pressures act
LOOSE_TOLERANCE = 8.0  # tolerance of the solves with these barriers, times the last one's
VISIBLE_STIFFNESS = 30.0  # resistance of a visible vertex to displacement, times that of a hidden one
ATTACHMENT_STIFFNESS = 1e2  # of springs at attached vertices, times the vertex's own
MOST_ROUNDS = 6  # rounds of the last solve; each changes the pressures
FORCE_TOLERANCE = 1e-2  # of the solves: moves decide


@dataclass(frozen=True)
class SeparationOptions:
    """Limits of the separation of surfaces.

    Parameters
    ----------
    reach : float
        Distance in mm over which a displacement fades along the surface.
    clearance : float
        Distance in mm within which surfaces press on one another.
    tolerance : float
        Tolerance in mm of the vertices.
    volume : float
        Relative change of a muscle's volume, at most (infinite: no volume is kept).
    iterations : int
        Iterations, at most.
    """

    reach: float = 3.0
    clearance: float = 0.05
    tolerance: float = 0.005
    volume: float = 0.008
    iterations: int = 300


NO_VOLUME = SeparationOptions(volume=np.inf)  # surfaces alone: any change of volume is allowed


@dataclass(frozen=True)
class Separation:
    """Separated surfaces, and how well they are separated.

    Parameters
    ----------
    surfaces : dict of str to Surface
        Separated surfaces in mm, by muscle.
    penetration_before, penetration : float
        Largest penetration in mm before and after.
    iterations : int
        Iterations of all solves.
    """

    surfaces: dict[str, Surface]
    penetration_before: float
    penetration: float
    iterations: int

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the surfaces as an artifact."""
        data = {n: {"vertices": s.vertices, "triangles": s.triangles} for n, s in self.surfaces.items()}
        artifacts.write(path, data, kind=KIND, units={f"{n}/vertices": "mm" for n in data}, inputs=inputs)


def load_surfaces(path: str | Path) -> dict[str, Surface]:
    """The surfaces that `Separation.save` wrote.

    Parameters
    ----------
    path : path
        Artifact.

    Returns
    -------
    dict of str to Surface
        Surfaces in mm, by muscle.

    Raises
    ------
    InputError
        Where the file is of another kind.
    """
    return {n: Surface(s["vertices"], s["triangles"]) for n, s in artifacts.read(path, KIND).items()}


def separate(
    muscles: Mapping[str, Surface],
    fixed: Mapping[str, Surface],
    options: SeparationOptions | None = None,
    *,
    attached: Mapping[str, IntArray] | None = None,
    visible: Mapping[str, BoolArray] | None = None,
) -> Separation:
    """Separate overlapping closed surfaces; both muscles of a pair move.

    Muscles are deflated until no bodies intersect. Then they grow back: the displacement u from their given
    shapes minimises reach^4 |lap u|^2 + |u|^2 (thin-plate bending and size) integrated over the surfaces,
    behind a barrier that no step crosses. Pressures keep the volumes.

    Parameters
    ----------
    muscles : mapping of str to Surface
        Closed surfaces in mm.
    fixed : mapping of str to Surface
        Closed surfaces in mm that do not move, as bones.
    options : SeparationOptions, optional
        Limits.
    attached : mapping of str to array (k,), optional
        Ids of each muscle's attached vertices, which neither move nor collide.
    visible : mapping of str to array (n,) of bool, optional
        Vertices of each muscle whose places an image shows. They resist displacement more than hidden ones.

    Returns
    -------
    Separation
        Separated surfaces; surfaces that do not intersect are returned unchanged.

    Raises
    ------
    Inseparable
        If bodies intersect however deflated.
    ConvergenceError
        If the volumes find no room, or the last solve has not converged.
    """
    options = options or SeparationOptions()
    nothing = np.zeros(0, dtype=np.int64)
    colliders = _Colliders(
        [
            Collider(n, s, np.asarray((attached or {}).get(n, nothing)), visible=(visible or {}).get(n))
            for n, s in muscles.items()
        ],
        [Collider(n, s, nothing, fixed=True) for n, s in fixed.items()],
    )
    rest = colliders.rest()
    before = colliders.penetration(rest)
    apart = disjoint_start(colliders.muscles, colliders.bones)
    if apart is None:
        return Separation(dict(muscles), before, before, 0)
    x, iterations = _grown(colliders, rest, np.concatenate(apart), options)
    surfaces = {
        n: b.surface.moved(x[p]) for n, b, p in zip(muscles, colliders.muscles, colliders.parts, strict=True)
    }
    for name, surface in surfaces.items():
        _name_folds(name, surface)
    return Separation(surfaces, before, colliders.penetration(x), iterations)


@dataclass(frozen=True)
class _Colliders:
    """Muscles, with their vertices concatenated in x (N, 3), and bones."""

    muscles: list[Collider]
    bones: list[Collider]

    @property
    def parts(self) -> list[slice]:
        starts = np.cumsum([0, *(len(b.surface.vertices) for b in self.muscles)])
        return [slice(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True)]

    def rest(self) -> Array:
        return np.concatenate([b.surface.vertices for b in self.muscles])

    def attached(self) -> IntArray:
        """Attached vertices, as indices into x."""
        return np.concatenate([b.attached + p.start for b, p in zip(self.muscles, self.parts, strict=True)])

    def penetration(self, x: Array) -> float:
        """Largest penetration in mm of a muscle into another or into a bone."""
        bodies = self.muscles + self.bones
        at = [b.surface.moved(x[p]) for b, p in zip(self.muscles, self.parts, strict=True)]
        distances = [Distance(s) for s in [*at, *(b.surface for b in self.bones)]]
        both = [*body_pairs(self.muscles, self.bones), *combinations(reversed(range(len(self.muscles))), 2)]
        return max((depth(bodies[i], at[i].vertices, distances[j]) for i, j in both), default=0.0)

    def barrier(self, x: Array, clearance: float) -> Barrier:
        """Barrier between the bodies, and of each muscle against itself, with muscles at x (N, 3).

        A muscle that cuts itself there does not collide with itself.
        """
        copies, triangles, start, first = [], [], 0, 0
        for body in self.muscles:
            vertices, faces = body.copies
            copies.append(vertices + start)
            triangles.append(faces + first)
            start, first = start + len(body.surface.vertices), first + len(vertices)
        chosen = np.concatenate(copies)
        operator = sparse.csr_matrix((np.ones(first), chosen, np.arange(first + 1)), shape=(first, len(x)))
        whole = [
            i for i, part in enumerate(self.parts) if not len(folds(self.muscles[i].surface.moved(x[part])))
        ]
        bodies = self.muscles + self.bones
        return Barrier(
            operator,
            np.concatenate(triangles),
            x,
            clearance,
            BARRIER_STIFFNESS,
            obstacle=_joined(self.bones),
            pairs=CollidingPairs(allowed=collision_filter(bodies, with_themselves=whole), rest=self.rest()),
        )


def _name_folds(name: str, surface: Surface) -> None:
    """Warn of a muscle that cuts itself, as one does whose start did so already."""
    vertices = folds(surface)
    if not len(vertices):
        return
    place = ", ".join(f"{c:.1f}" for c in np.median(surface.vertices[vertices], axis=0))
    text = "separation: %s cuts itself at %d vertices, around (%s) mm; look at it there"
    log.warning(text, name, len(vertices), place)


def _joined(bones: Sequence[Collider]) -> tuple[Array, IntArray] | None:
    if not bones:
        return None
    starts = np.cumsum([0, *(len(b.surface.vertices) for b in bones)])
    triangles = [b.surface.triangles + s for b, s in zip(bones, starts, strict=False)]
    return np.concatenate([b.surface.vertices for b in bones]), np.concatenate(triangles)


def _grown(colliders: _Colliders, rest: Array, start: Array, options: SeparationOptions) -> tuple[Array, int]:
    """Vertices (N, 3) at the minimum with volumes kept, and the number of iterations."""
    surfaces = [b.surface for b in colliders.muscles]
    plates = [_plate(b, options.reach) for b in colliders.muscles]
    plate = Plate(sparse.block_diag(plates, format="csr"), rest)
    barrier = colliders.barrier(start, options.clearance)
    settings = equilibrium.Options(
        displacement_tolerance=options.tolerance,
        force_tolerance=FORCE_TOLERANCE,
        max_iterations=options.iterations,
        allow_partial=True,
        untangle=False,
        name="separation",
    )
    loose = replace(settings, displacement_tolerance=LOOSE_TOLERANCE * options.tolerance, force_tolerance=1.0)
    compliances = np.array([_compliance(s, k) for s, k in zip(surfaces, plates, strict=True)])
    volumes = KeptVolumes(surfaces, colliders.parts, compliances, options.volume)
    x, iterations = start, 0
    # Behind a barrier of long range, bodies move apart before they touch.
    for times in BARRIER_RANGES:
        soft = ConvexBarrier(barrier.reaching(times * options.clearance))
        forces: list[Potential] = [plate, soft] if times > PRESSURE_RANGE else [plate, soft, volumes]
        found = equilibrium.solve(forces, x, options=loose)
        x, iterations = found.x, iterations + found.record.iterations
    hard = ConvexBarrier(barrier)
    for _ in range(MOST_ROUNDS):
        found = equilibrium.solve([plate, hard, volumes], x, options=settings)
        x, iterations = found.x, iterations + found.record.iterations
        log.info("separation: volumes changed by up to %.2f %%", 100 * np.abs(volumes.changes(x)).max())
        if found.record.converged and volumes.kept(x):
            return _attached_at_rest(colliders, rest, x, barrier), iterations
        volumes.renew(x)
    largest = 100 * np.abs(volumes.changes(x)).max()
    problem = f"{iterations} iterations, volumes changed by up to {largest:.1f} %: {found.record.reason}"
    raise ConvergenceError("Separation of muscles", problem)


def _plate(body: Collider, reach: float) -> sparse.csr_matrix:
    """Stiffness (n, n) of a muscle's surface, with springs at attached and visible vertices."""
    plate = thin_plate(body.surface, reach)
    pull = np.zeros(plate.shape[0])
    if body.visible is not None:
        mass = mass_lumped(body.surface.vertices, body.surface.triangles)
        pull[body.visible] = VISIBLE_STIFFNESS * mass[body.visible]
    pull[body.attached] = ATTACHMENT_STIFFNESS * plate.diagonal()[body.attached]
    return sparse.csr_matrix(plate + sparse.diags(pull))


def _attached_at_rest(colliders: _Colliders, rest: Array, x: Array, barrier: Barrier) -> Array:
    """Positions x with attached vertices exactly at rest, if no bodies intersect then."""
    placed, attached = x.copy(), colliders.attached()
    placed[attached] = rest[attached]
    if not barrier.intersects(placed):
        return placed
    off = np.linalg.norm(x[attached] - rest[attached], axis=1).max()
    log.warning(
        "separation: attached vertices stay up to %.4f mm off their places: at rest bodies intersect there",
        off,
    )
    return x


def _compliance(surface: Surface, plate: sparse.csr_matrix) -> float:
    """Change of a free surface's volume per unit of its pressure, in mm^3 per mm."""
    gradient = volume_gradient(surface)
    return float(np.vdot(gradient, splu(plate.tocsc()).solve(gradient)))
