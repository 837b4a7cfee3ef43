"""Displacement error over seconds: for tolerance, mesh size, material and solver kind."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from unittest import mock

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.fem.machine import REPEATS, Figures, figure
from benchmarks.fem.scenes import turned
from benchmarks.fem.twist import Beam
from handpipe.core import Array
from handpipe.fem.elements import Material
from handpipe.fem.elements.materials import Model
from handpipe.fem.linear import system_sequence
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Options, Steps, continuation

log = logging.getLogger(__name__)

TURN, STEP = 90.0, 1 / 3  # degrees of one end, and the share of it in a step
SIZES = (2, 4, 6, 8)  # cells across, of which 2 divides all: their vertices are those of SIZES[0] too
TRUTH = 12  # cells across in the refined solution
SOLVER_SIZE = 8  # cells across where solver kinds and tolerances are compared
TOLERANCES = (1e0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5)  # mm, of a Newton step
TIGHT = 1e-8
MATERIALS: dict[str, tuple[Model, float]] = {
    "neo-Hookean, 0.3": ("stable-neo-hookean", 0.3),
    "neo-Hookean, 0.45": ("stable-neo-hookean", 0.45),
    "neo-Hookean, 0.49": ("stable-neo-hookean", 0.49),
    "StVK, 0.3": ("stvk", 0.3),
}
SOLVERS = ("direct", "old factor and CG", "multigrid and CG")


def measure(
    sizes: Sequence[int] = SIZES, truth: int = TRUTH, solver_size: int = SOLVER_SIZE, repeats: int = REPEATS
) -> Figures:
    """Curves as lists `error_by_{what}: {name}, seconds | errors | at`; `at` are cells or tolerances."""
    _solved(sizes[0], "neo-Hookean, 0.45", 1e-2)  # compiles
    return _by_mesh(sizes, truth, repeats) | _by_solver(solver_size, repeats)


def _by_mesh(sizes: Sequence[int], truth: int, repeats: int) -> Figures:
    """For each material: error against the refined and fully converged solution, of ever finer meshes."""
    places = Beam.build(sizes[0]).body.vertices
    figures: Figures = {}
    for name in MATERIALS:
        exact = _at(places, *_solved(truth, name, TIGHT))
        seconds, errors = [], []
        for cells in sizes:
            taken, shapes = _repeated(cells, name, 1e-4, repeats)
            seconds.append(taken)
            errors.append(_error(_at(places, *shapes), exact))
            log.info("%s, %d cells across: %.2f s, error %.2e", name, cells, taken, errors[-1])
        figures |= _curve("mesh and material", name, seconds, errors, list(sizes), "cells across")
    return figures


def _by_solver(cells: int, repeats: int) -> Figures:
    """For each solver kind: error against the fully converged solution of the same mesh, by tolerance."""
    exact = _solved(cells, "neo-Hookean, 0.45", TIGHT)[1]
    figures: Figures = {}
    for kind in SOLVERS:
        seconds, errors = [], []
        for tolerance in TOLERANCES:
            with _solver(kind):
                taken, (_, x) = _repeated(cells, "neo-Hookean, 0.45", tolerance, repeats)
            seconds.append(taken)
            errors.append(_error(x, exact))
            log.info("%s, tolerance %.0e mm: %.2f s, error %.2e", kind, tolerance, taken, errors[-1])
        figures |= _curve("tolerance and solver", kind, seconds, errors, list(TOLERANCES), "mm")
    return figures


def _curve(
    what: str, name: str, seconds: list[float], errors: list[float], at: Sequence[float], unit: str
) -> Figures:
    return {
        f"error_by_{what}: {name}, seconds": {"value": seconds, "unit": "s"},
        f"error_by_{what}: {name}, errors": {"value": errors, "unit": "mm"},
        f"error_by_{what}: {name}, at": {"value": list(at), "unit": unit},
        f"error_by_{what}: {name}, last": figure(errors[-1], "mm"),
    }


def _repeated(cells: int, material: str, tolerance: float, repeats: int) -> tuple[float, tuple[Array, Array]]:
    """Median seconds of a solve, and its rest and final positions."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        shapes = _solved(cells, material, tolerance)
        times.append(time.perf_counter() - begun)
    return float(np.median(times)), shapes


def _solved(cells: int, material: str, tolerance: float) -> tuple[Array, Array]:
    """Rest and final positions (n, 3) of the beam with one end turned."""
    beam = Beam.build(cells)
    x, right = beam.body.vertices, beam.body.where(0, 4.0)
    model, poisson = MATERIALS[material]
    elastic = Elastic(x, beam.body.tets, Material(1.0, poisson, model))
    # Tolerances of forces follow those of displacements; the first never decide alone.
    last = Options(displacement_tolerance=tolerance, force_tolerance=max(tolerance, 1e-10), name=material)
    loose = Options(displacement_tolerance=max(tolerance, 0.1), force_tolerance=max(tolerance, 0.1))
    found = continuation(
        lambda t: [elastic],
        x,
        fixed=np.repeat(beam.clamped, 3),
        prescribed=lambda t: turned(x, right, (1.0, 0.0, 0.0), TURN * t, (0.0, 0.5, 0.5)),
        options=last,
        steps=Steps(first=STEP, largest=STEP, intermediate=loose),
    )
    return x, found.x


def _at(places: Array, rest: Array, x: Array) -> Array:
    """Positions (k, 3) of the vertices that are at `places` (k, 3) at rest."""
    distances, indices = cKDTree(rest).query(places)
    if distances.max() > 1e-9:
        raise ValueError("the meshes have no vertices at these places")
    return x[indices]


def _error(x: Array, exact: Array) -> float:
    """Root mean square over vertices, in mm."""
    return float(np.sqrt(((x - exact) ** 2).sum(axis=1).mean()))


@contextmanager
def _solver(kind: str) -> Iterator[None]:
    """Make every sequence of systems solve in one way."""
    if kind == "direct":  # an old factor never serves
        with mock.patch.object(system_sequence, "LEAST_SAVING", np.inf):
            yield
    elif kind == "multigrid and CG":  # no factor fits
        with mock.patch.object(system_sequence, "_default_limit", lambda: 0.0):
            yield
    else:
        with mock.patch.object(system_sequence, "LEAST_SAVING", 0.0):
            yield
