"""Whole fits at the scale of Wang 2021 Table 5.2, and with marks by the ten thousand.

The shapes to be found come from closed-form maps, which know nothing of strains or elasticity. Marks lie on
the true surface, without noise.
"""

from __future__ import annotations

import logging
import time

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.fem.machine import Figures, figure, peak_memory
from benchmarks.shapes.bodies import liver, muscle, scattered, surface_errors
from benchmarks.shapes.solves import ends, target
from handpipe.core import Array
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs import Observed, fit_organ
from handpipe.shapes.organs.organ import OrganFit

log = logging.getLogger("benchmarks.shapes")

MEDIUM, MANY = 32, 10_000
LIVER = 424
FAR = 1.8  # marks are 9 mm away in the mean once the template is placed


def measure(edge: float = 0.74, liver_edge: float = 4.05, many: int = MANY) -> Figures:
    """`muscle_med_…`, `liver_…`, `dense_…`."""
    return medium(edge) | unattached(liver_edge) | dense(edge, many)


def medium(edge: float = 0.74) -> Figures:
    """A hand muscle, attached, 32 marks."""
    mesh = muscle(edge)
    wanted = target(mesh)
    return _fitted("muscle_med", mesh, wanted, scattered(wanted.boundary(), MEDIUM), ends(mesh, wanted))


def dense(edge: float = 0.74, marks: int = MANY) -> Figures:
    """The same muscle with marks by the ten thousand."""
    mesh = muscle(edge)
    wanted = target(mesh)
    points = scattered_many(wanted, marks)
    found = _fitted("dense", mesh, wanted, points, ends(mesh, wanted))
    return found | {
        "dense_peak_memory": figure(peak_memory(), "GiB"),
        "dense_marks": figure(float(marks), "1"),
    }


def unattached(edge: float = 4.05) -> Figures:
    """A liver, far away, that nothing holds, 424 marks and six landmarks."""
    mesh = liver(edge)
    wanted = grown_liver(mesh, FAR)
    points = scattered(wanted.boundary(), LIVER)
    settings = OrganSettings(iterations=40)
    return _fitted("liver", mesh, wanted, points, None, extremes(mesh, wanted), settings)


def extremes(mesh: TetMesh, wanted: TetMesh) -> Pairs:
    """Landmarks at the least and largest coordinates of the boundary."""
    outer = mesh.boundary_vertices()
    found = np.unique([outer[f(mesh.vertices[outer, c])] for c in range(3) for f in (np.argmin, np.argmax)])
    return Pairs(mesh.vertices[found], wanted.vertices[found])


def grown_liver(mesh: TetMesh, growth: float = 1.0) -> TetMesh:
    """Another person's: larger to one side, thinner, bent, turned; `growth` times as much."""
    size = np.abs(mesh.vertices).max()
    x, y, z = mesh.vertices.T / size
    grown = [x * (0.1 + 0.15 * x), 0.15 * x**2 - y * (0.15 + 0.2 * x), z * (0.05 + 0.3 * x)]
    grown[2] += 0.1 * np.sin(2.5 * x) - 0.1 * y**2
    shape = np.column_stack([x, y, z]) + growth * np.column_stack(grown)
    return mesh.moved(size * shape @ Rotation.from_euler("zx", [12, -8], degrees=True).as_matrix().T)


def scattered_many(wanted: TetMesh, count: int) -> Array:
    """Points on the surface by the thousand, at random."""
    surface = wanted.boundary()
    rng = np.random.default_rng(0)
    areas = surface.triangle_areas()
    triangles = surface.triangles[rng.choice(len(areas), count, p=areas / areas.sum())]
    weights = rng.dirichlet(np.ones(3), count)
    return np.einsum("kc,kcd->kd", weights, surface.vertices[triangles])


def _fitted(
    name: str,
    mesh: TetMesh,
    wanted: TetMesh,
    marks: Array,
    attached: Pairs | None,
    landmarks: Pairs | None = None,
    settings: OrganSettings | None = None,
) -> Figures:
    begun, begun_processor = time.perf_counter(), time.process_time()
    fit: OrganFit = fit_organ(mesh, Observed(marks, attached, landmarks), settings=settings)
    seconds, processor = time.perf_counter() - begun, time.process_time() - begun_processor
    log.info("%s: %d tets, %.1f s, of the processor %.1f s", name, len(mesh.tets), seconds, processor)
    errors = surface_errors(fit.mesh, wanted)
    out: Figures = {
        f"{name}_seconds": figure(seconds, "s"),
        f"{name}_processor_seconds": figure(processor, "s"),
        f"{name}_vertices": figure(float(len(mesh.vertices)), "1"),
        f"{name}_tets": figure(float(len(mesh.tets)), "1"),
        f"{name}_steps": figure(float(len(fit.record)), "1"),
        f"{name}_surface_mean": figure(float(errors.mean()), "mm"),
        f"{name}_surface_max": figure(float(errors.max()), "mm"),
    }
    return out | {f"{name}_{key}": figure(value, unit) for key, (value, unit) in fit.quality.items()}
