"""What a muscle's surface resists when it is pushed: a thin plate's bending and size; a pressure inside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from handpipe.mesh.operators import cotangent_laplacian, mass_lumped
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]


def thin_plate(surface: Surface, reach: float) -> sparse.csr_matrix:
    """Matrix (n, n) of the energy 1/2 of reach^4 |lap u|^2 + |u|^2 integrated over the surface.

    A displacement that is forced somewhere fades over `reach` mm.
    """
    mass = mass_lumped(surface.vertices, surface.triangles)
    laplacian = cotangent_laplacian(surface.vertices, surface.triangles)
    bending = laplacian @ sparse.diags(1 / mass) @ laplacian
    return sparse.csr_matrix(reach**4 * bending + sparse.diags(mass))


class Plate:
    """Energy 1/2 (x - rest)^T (K x I) (x - rest) of displacements from rest (n, 3), K (n, n)."""

    def __init__(self, stiffness: sparse.csr_matrix, rest: Array) -> None:
        self._stiffness, self._rest = stiffness, rest
        self._wide = sparse.kron(stiffness, sparse.eye(3), format="csr")

    def value(self, x: Array) -> float:
        return 0.5 * float(np.vdot(x - self._rest, self.gradient(x)))

    def gradient(self, x: Array) -> Array:
        return np.asarray(self._stiffness @ (x - self._rest))

    def hessian(self, x: Array, project: bool = False) -> sparse.csr_matrix:
        return self._wide


class Pressure:
    """Energy -p V of the volume inside each closed surface; its second derivative is left out.

    bodies: each surface's vertices in x and its triangles on them. Pressures are small against the plate's
    stiffness times radii of curvature, so that Newton's method without the second derivative still converges
    by an order of magnitude in every step.
    """

    def __init__(self, surfaces: Sequence[Surface], parts: Sequence[slice], pressures: Array) -> None:
        self._bodies = list(zip(surfaces, parts, pressures, strict=True))
        size = 3 * parts[-1].stop
        self._zero = sparse.csr_matrix((size, size))

    def value(self, x: Array) -> float:
        return -sum(p * s.moved(x[part]).volume() for s, part, p in self._bodies if p != 0)

    def gradient(self, x: Array) -> Array:
        total = np.zeros_like(x)
        for surface, part, pressure in self._bodies:
            if pressure != 0:
                total[part] = -pressure * volume_gradient(surface.moved(x[part]))
        return total

    def hessian(self, x: Array, project: bool = False) -> sparse.csr_matrix:
        return self._zero


def volume_gradient(surface: Surface) -> Array:
    """Derivative (n, 3) of the enclosed volume by the vertices."""
    gradient = np.zeros_like(surface.vertices)
    points = surface.vertices[surface.triangles]
    for corner in range(3):
        opposite = np.cross(points[:, (corner + 1) % 3], points[:, (corner + 2) % 3]) / 6
        np.add.at(gradient, surface.triangles[:, corner], opposite)
    return gradient
