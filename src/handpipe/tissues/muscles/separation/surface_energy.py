"""Energies of a muscle's surface: bending and size of a thin plate, and pressures that keep the volume."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import cotangent_laplacian, mass_lumped

SETTLED = 0.1  # mm, largest motion of a body in a step after which its pressure may change


def thin_plate(surface: Surface, reach: float) -> sparse.csr_matrix:
    """Matrix (n, n) of the energy 1/2 of reach^4 |lap u|^2 + |u|^2 integrated over the surface.

    A local displacement fades over `reach` mm.
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
        """Energy at positions x (n, 3) in mm; zero at rest."""
        return 0.5 * float(np.vdot(x - self._rest, self.gradient(x)))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) at positions x (n, 3) in mm: K (x - rest)."""
        return np.asarray(self._stiffness @ (x - self._rest))

    def hessian(self, x: Array, project: bool = False) -> sparse.csr_matrix:
        """Second derivative (3n, 3n): K x I, constant; `project` is ignored."""
        return self._wide


class KeptVolumes:
    """Energy -sum p V of the volumes V inside closed surfaces, with pressures p that keep these volumes.

    The pressures change between Newton steps until the volumes are in their band. Each change is the one that
    a free surface would need. Contact leaves a surface at least a fifth of its compliance: no change is too
    large, and a few suffice. The Hessian is zero, not the second derivative: pressures are small against the
    plate's stiffness times radii of curvature, and Newton's method still gains an order of magnitude a step.

    Parameters
    ----------
    surfaces : sequence of Surface
        The closed surfaces at rest.
    parts : sequence of slice
        Each surface's vertices in x.
    compliances : (bodies,)
        Change of a surface's volume by its pressure where it is free, in mm^3 per mm.
    band : float
        Relative change of a volume, at most.
    """

    def __init__(
        self, surfaces: Sequence[Surface], parts: Sequence[slice], compliances: Array, band: float
    ) -> None:
        self._bodies = list(zip(surfaces, parts, strict=True))
        self._rest = np.array([s.volume() for s in surfaces])
        self._compliances, self._band = compliances, band
        self._zero = sparse.csr_matrix((3 * parts[-1].stop, 3 * parts[-1].stop))
        self._last: Array | None = None
        self.pressures = np.zeros(len(surfaces))

    def changes(self, x: Array) -> Array:
        """Relative changes (bodies,) of the volumes at x (n, 3)."""
        return self._volumes(x) / self._rest - 1

    def kept(self, x: Array) -> bool:
        """Whether all volumes are in their band."""
        return bool((np.abs(self.changes(x)) <= self._band).all())

    def value(self, x: Array) -> float:
        """Energy at positions x (n, 3) in mm under the present pressures: -sum p V."""
        return -float(self.pressures @ self._volumes(x))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) at positions x (n, 3) in mm, with pressures constant."""
        total = np.zeros_like(x)
        for (surface, part), pressure in zip(self._bodies, self.pressures, strict=True):
            total[part] = -pressure * volume_gradient(surface.moved(x[part]))
        return total

    def hessian(self, x: Array, project: bool = False) -> sparse.csr_matrix:
        """Zero (3n, 3n) in place of the second derivative."""
        return self._zero

    def refresh(self, x: Array) -> None:
        """Change the pressures of bodies that have settled: others still respond to the last change."""
        if self._last is not None:
            moved = np.linalg.norm(x - self._last, axis=1)
            self.renew(x, np.array([moved[part].max() < SETTLED for _, part in self._bodies]))
        self._last = x

    def renew(self, x: Array, chosen: BoolArray | None = None) -> None:
        """Change the pressures where volumes are beyond half their band: of all or of chosen (bodies,)."""
        changes, half = self.changes(x), 0.5 * self._band
        missing = self._rest * (np.clip(changes, -half, half) - changes)
        if chosen is not None:
            missing[~chosen] = 0.0
        self.pressures = self.pressures + missing / self._compliances

    def _volumes(self, x: Array) -> Array:
        return np.array([surface.moved(x[part]).volume() for surface, part in self._bodies])


def volume_gradient(surface: Surface) -> Array:
    """Derivative (n, 3) of the enclosed volume by the vertices."""
    gradient = np.zeros_like(surface.vertices)
    points = surface.vertices[surface.triangles]
    for corner in range(3):
        opposite = np.cross(points[:, (corner + 1) % 3], points[:, (corner + 2) % 3]) / 6
        np.add.at(gradient, surface.triangles[:, corner], opposite)
    return gradient
