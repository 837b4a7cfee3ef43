"""Known strains (Wang 2021 Fig. 5.19): a body attached at its back and pulled at its head, under a known
plastic field.

Marks are vertices of the surface with their places, as landmarks. The field is smooth but no combination of
smooth eigenvectors: a growth that varies along and across, a contraction in the middle, a shear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import farthest, muscle
from handpipe.core import Array
from handpipe.fem.contact import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Elastic, Pull
from handpipe.fem.solver import equilibrium
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation import MUSCLE
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs import Observed, fit_organ
from handpipe.shapes.organs.organ import OrganFit

PULL = 6.0  # mN
SETTINGS = OrganSettings(alpha=100.0, beta=100.0, enough=1e-3, progress=1e-3)


@dataclass(frozen=True)
class Case:
    """A template, what holds and pulls it, its strains and the shape that they give."""

    mesh: TetMesh
    attached: Pairs
    load: Pull
    strains: Array
    truth: Array

    @staticmethod
    def build(edge: float) -> Case:
        mesh = muscle(edge)
        x = mesh.vertices
        place = (x - x.min(axis=0)) / np.ptp(x, axis=0)
        outer = mesh.boundary_vertices()
        back, head = outer[place[outer, 0] < 0.12], outer[place[outer, 0] > 0.9]
        attached = Pairs(x[back], x[back])
        pulled = Pairs(x[head], x[head]).attached(mesh).matrix
        load = Pull(pulled, np.tile([0.0, PULL / len(head), 0.0], (len(head), 1)))
        strains = plasticity.exp(field(place[mesh.tets].mean(axis=1)))
        springs = Attachment(attached.attached(mesh).matrix, attached.targets, SETTINGS.spring)
        body = Elastic(x, mesh.tets, MUSCLE, strains)
        return Case(mesh, attached, load, strains, equilibrium.solve([body, springs, load], x).x)

    def fit(self, marks: int) -> OrganFit:
        """The organ fitted to that many surface vertices."""
        outer = self.mesh.boundary_vertices()
        points = farthest(self.mesh.vertices[outer], marks)
        chosen = np.array([int(np.abs(self.mesh.vertices - p).sum(axis=1).argmin()) for p in points])
        pairs = Pairs(points, self.truth[chosen])
        return fit_organ(
            self.mesh,
            Observed(landmarks=pairs, attachments=self.attached),
            loads=[self.load],
            settings=SETTINGS,
        )

    def strain_errors(self, found: Array) -> Array:
        """Relative errors (m,) of plastic strains (m, 6), in the Frobenius norm."""
        return _size(found - self.strains) / _size(self.strains)

    def growth_error(self, found: Array) -> float:
        """Mean error of the strains over the mean of what they differ from the identity by."""
        return float(_size(found - self.strains).mean() / _size(self.strains - plasticity.IDENTITY).mean())

    def surface_errors(self, x: Array) -> Array:
        """Distances of the surface's vertices from their true places, of the diagonal."""
        outer = self.mesh.boundary_vertices()
        diagonal = np.linalg.norm(np.ptp(self.truth, axis=0))
        return np.linalg.norm((x - self.truth)[outer], axis=1) / diagonal


def field(place: Array) -> Array:
    """Log-strains (m, 6) at places (m, 3) in the unit cube: eigenvalues of 0.7 to 1.6."""
    x, y, z = place.T
    logs = np.zeros((len(place), 6))
    logs[:, 0] = 0.35 * x - 0.1
    logs[:, 3] = 0.4 * np.sin(np.pi * x) * (0.6 + 0.4 * y)
    logs[:, 5] = -0.25 * x**2 + 0.1 * z
    logs[:, 1] = 0.12 * np.cos(np.pi * x)
    return logs


def _size(strains: Array) -> Array:
    return np.linalg.norm(plasticity.to_matrices(strains), axis=(1, 2))


def measure(edges: tuple[float, ...] = (1.8, 1.4, 1.06), counts: tuple[int, ...] = (122, 488)) -> Figures:
    """`known_strains_…_{tets}_{marks}`: errors by mesh size and number of marks."""
    out: Figures = {}
    for edge in edges:
        case = Case.build(edge)
        for marks in counts:
            if marks > len(case.mesh.boundary_vertices()):
                continue
            fit = case.fit(marks)
            key = f"{len(case.mesh.tets)}_{marks}"
            strain, surface = case.strain_errors(fit.strains), case.surface_errors(fit.mesh.vertices)
            out |= {
                f"known_strains_strain_mean_{key}": figure(float(100 * strain.mean()), "%"),
                f"known_strains_strain_max_{key}": figure(float(100 * strain.max()), "%"),
                f"known_strains_growth_{key}": figure(100 * case.growth_error(fit.strains), "%"),
                f"known_strains_surface_mean_{key}": figure(float(100 * surface.mean()), "%"),
                f"known_strains_surface_max_{key}": figure(float(100 * surface.max()), "%"),
                f"known_strains_seconds_{key}": figure(sum(r.seconds for r in fit.record), "s"),
            }
    return out
