"""Solution methods against tangles: compressible substitutes of bodies, and starts from the rest shape.

Nearly incompressible bodies have many minima with inverted tets or with tets that surround an edge twice,
since untangling them needs a change of volume. With a Poisson's ratio of 0.3 such minima are few.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray
from handpipe.fem.elements.crushing import STEEPEST
from handpipe.fem.linear.factorisation import factorise
from handpipe.fem.minimisation.newton import Newton
from handpipe.fem.minimisation.record import Equilibrium, Options, Record
from handpipe.fem.minimisation.spacing import spacing
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.potential import Sum
from handpipe.mesh.tets import dirichlet_matrix

TURNING = (0.3, 0.03, 0.003)  # shares below which the barrier is quadratic, while inverted tets turn over
LOOSE = 0.02  # of the spacing of vertices: steps below it end the phase
LOOSE_FORCE = 1e-2  # force tolerance of that phase, at least


def tangles(energy: Sum, x: Array) -> int:
    """Number of inverted tets and of inner edges not surrounded once, over all bodies at x (n, 3)."""
    return sum(p.tangles.count(x) for p in energy.potentials if isinstance(p, Elastic))


def inverted(energy: Sum, x: Array) -> int:
    """Number of inverted tets, over all bodies at x (n, 3)."""
    return sum(p.tangles.inverted(x) for p in energy.potentials if isinstance(p, Elastic))


def least_volume(energy: Sum, x: Array) -> float:
    """The least det(F Fp^-1) of all bodies at x (n, 3)."""
    bodies = [p for p in energy.potentials if isinstance(p, Elastic)]
    return min((float(b.volume_ratios(x).min()) for b in bodies), default=np.inf)


def with_barrier(energy: Sum, steepest: float) -> Sum:
    """The energy and the barrier that keeps its bodies' tets from inversion."""
    bodies = [p for p in energy.potentials if isinstance(p, Elastic)]
    return Sum([*energy.potentials, *(b.crushing(steepest) for b in bodies)])


def nearly_incompressible(energy: Sum) -> bool:
    """Whether the compressible substitute would be softer than some body."""
    return any(isinstance(p, Elastic) and p.nearly_incompressible() for p in energy.potentials)


def by_stand_in(
    energy: Sum, x: Array, free: BoolArray, options: Options, workspace: Workspace
) -> Equilibrium:
    """A shape near equilibrium of the compressible substitute of every body, from x (n, 3)."""
    bodies = [p.compressible() if isinstance(p, Elastic) else p for p in energy.potentials]
    loose = replace(
        options,
        displacement_tolerance=max(options.displacement_tolerance, LOOSE * spacing(x)),
        force_tolerance=max(options.force_tolerance, LOOSE_FORCE),
        enough=None,
        name=f"{options.name}, stand-in",
    )
    newton = Newton(Sum(bodies), x, free, loose, workspace)
    newton.run()
    record = Record(
        untangled=newton.record.iterations,
        factorisations=newton.record.factorisations,
        cg_iterations=newton.record.cg_iterations,
        seconds=newton.record.seconds,
    )
    return Equilibrium(newton.x, record)


def uncrushed(energy: Sum, x: Array, free: BoolArray, options: Options, workspace: Workspace) -> Newton:
    """The minimum near x (n, 3) of the energy with a barrier on volume.

    Where tets are inverted at x the barrier is quadratic at first: they turn over before it is steep.
    """
    record, options = Record(), replace(options, enough=None)
    brief = replace(options, name=f"{options.name}, tets turn over")
    for steepest in TURNING:
        if least_volume(energy, x) > 0.0:
            break
        newton = Newton(with_barrier(energy, steepest), x, free, brief, workspace)
        newton.run()
        record.add(newton.record)
        x = newton.x
    last = replace(options, name=f"{options.name}, with a barrier on volume")
    newton = Newton(with_barrier(energy, STEEPEST), x, free, last, workspace)
    newton.run()
    record.add(newton.record)
    newton.record = record
    return newton


def from_rest(energy: Sum, x: Array, free: BoolArray) -> Array:
    """The rest shapes carried along with the fixed degrees of freedom of x (n, 3): argmin sum V |F - I|^2.

    Vertices of no body stay; bodies without fixed degrees of freedom get their rest positions.
    """
    bodies = [p for p in energy.potentials if isinstance(p, Elastic)]
    laplacian = sp.csr_matrix(
        sum(dirichlet_matrix(b.tets, b.rest_gradients, b.volumes, len(x)) for b in bodies)
    )
    rest, start = x.copy(), x.copy()
    used = laplacian.diagonal() > 0
    for body in bodies:
        rest[body.tets] = body.vertices[body.tets]
    for i in range(3):
        unknown = used & free[i::3]
        start[unknown, i] = rest[unknown, i]
        if not (used & ~unknown).any() or not unknown.any():
            continue
        block = sp.csr_matrix(laplacian[unknown][:, unknown])
        pull = laplacian @ np.where(unknown, 0.0, x[:, i] - rest[:, i])
        start[unknown, i] -= factorise(_steadied(block)).solve(pull[unknown])
    return start


def _steadied(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Matrix with a little added to the diagonal, for parts without fixed degrees of freedom."""
    return sp.csr_matrix(matrix + 1e-10 * float(matrix.diagonal().mean()) * sp.eye(matrix.shape[0]))
