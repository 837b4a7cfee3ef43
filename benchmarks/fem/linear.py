"""Linear solves: seconds by backend and size, multigrid by nu and contrast, old factors against new ones."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.sparse as sp
import skfem

from handpipe.core import Array, HandpipeError
from handpipe.fem.elements import Material
from handpipe.fem.linear.conjugate_gradients import End, conjugate_gradients
from handpipe.fem.linear.factor import Factor
from handpipe.fem.linear.factorisation import CLASSES, PRESENT
from handpipe.fem.linear.multigrid import Multigrid
from handpipe.fem.linear.system_sequence import SystemSequence
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials import Elastic

Figures = dict[str, dict[str, float | str | None]]

REPEATS = 3
MULTIGRID_MOST = 300  # iterations
SUPERLU_MOST = 10_000  # unknowns: beyond, SuperLU takes too long for a benchmark


class Bar:
    """A bar 2 x 1 x 1 with 2 n cells along it, clamped at one end; `matrix(...)` are its tangents."""

    def __init__(self, n: int) -> None:
        axes = (np.linspace(0, s, c * n + 1) for s, c in ((2, 2), (1, 1), (1, 1)))
        mesh = skfem.MeshTet.init_tensor(*axes)
        self.vertices, tets = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
        corners = self.vertices[tets]
        negative = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
        tets[negative] = tets[negative][:, [0, 1, 3, 2]]
        self.tets = tets
        self.free = np.repeat(self.vertices[:, 0] > 0, 3)

    def matrix(self, poisson: float, young: Array | float = 6.0, x: Array | None = None) -> sp.csr_matrix:
        """Positive definite stiffness (N, N) of the unknowns at x, by default at rest."""
        body = Elastic(self.vertices, self.tets, Material(young, poisson))
        full = body.hessian(self.vertices if x is None else x, project=x is not None)
        return FreeBlock(full, self.free).matrix(full)

    def bent(self, turn: float) -> Array:
        """Positions with the bar bent into an arc of `turn` radians."""
        along, across = self.vertices[:, 0], self.vertices[:, 1]
        if turn == 0.0:
            return self.vertices.copy()
        radius = 2.0 / turn
        angle = along / radius
        bent = self.vertices.copy()
        bent[:, 0] = (radius - across) * np.sin(angle)
        bent[:, 1] = radius - (radius - across) * np.cos(angle)
        return bent


def measure(cells: tuple[int, ...] = (9, 14, 20), large: int = 14) -> Figures:
    """Figures by name, {value, unit}: by size for each of `cells` across the bar, the others at `large`."""
    figures: Figures = {}
    for n in cells:
        figures |= _backends(Bar(n))
    bar = Bar(large)
    figures |= _multigrid(bar)
    figures |= _newton_sequence(bar)
    return figures


def _backends(bar: Bar) -> Figures:
    matrix = bar.matrix(0.48)
    unknowns = matrix.shape[0]
    b = np.random.default_rng(0).normal(size=unknowns)
    figures: Figures = {}
    for name, backend in CLASSES.items():
        if not PRESENT[name]() or (name == "scipy" and unknowns > SUPERLU_MOST):
            continue
        label = f"{name}_{unknowns}"
        factor = backend(matrix, True, np.inf)
        again = _seconds(partial(factor.refactorise, matrix))
        solve = _seconds(partial(factor.solve, b))
        price = again / (solve + _seconds(lambda: matrix @ b))
        figures[f"{label}_refactorise"] = {"value": again, "unit": "s"}
        figures[f"{label}_solve"] = {"value": solve, "unit": "s"}
        work = factor.work.flops / factor.work.entries
        figures[f"{label}_iterations_per_factor"] = {"value": price, "unit": "1"}
        figures[f"{label}_balance"] = {"value": work / price, "unit": "1"}
        figures[f"{label}_memory"] = {"value": factor.work.bytes / 2**20, "unit": "MiB"}
    return figures


def _multigrid(bar: Bar) -> Figures:
    """Iterations to 1e-3 and 1e-8; no value where they do not converge."""
    upper = bar.vertices[bar.tets][:, :, 2].mean(axis=1) > 0.5
    random = np.random.default_rng(0).random(len(bar.tets)) < 0.5
    cases: dict[str, tuple[float, Array | float]] = {
        f"nu_{nu}": (nu, 6.0) for nu in (0.3, 0.45, 0.48, 0.49, 0.499)
    }
    cases["contrast_1e6_halves"] = (0.48, np.where(upper, 6e6, 6.0))
    cases["contrast_1e6_tets_at_random"] = (0.48, np.where(random, 6e6, 6.0))
    figures: Figures = {}
    for name, (poisson, young) in cases.items():
        matrix = bar.matrix(poisson, young)
        b = np.random.default_rng(0).normal(size=matrix.shape[0])
        start = time.perf_counter()
        try:
            preconditioner = Multigrid(matrix, bar.free, bar.vertices)
        except HandpipeError:
            figures[f"multigrid_{name}_iterations"] = {"value": None, "unit": "1"}
            continue
        figures[f"multigrid_{name}_setup"] = {"value": time.perf_counter() - start, "unit": "s"}
        for tolerance in (1e-3, 1e-8):
            start = time.perf_counter()
            found = conjugate_gradients(matrix, b, preconditioner, tolerance, MULTIGRID_MOST, foretell=False)
            seconds = time.perf_counter() - start
            count = float(found.count) if found.end is End.CONVERGED else None
            figures[f"multigrid_{name}_iterations_{tolerance:.0e}"] = {"value": count, "unit": "1"}
            figures[f"multigrid_{name}_solve_{tolerance:.0e}"] = {"value": seconds, "unit": "s"}
    return figures


def _newton_sequence(bar: Bar) -> Figures:
    """Five loads of four Newton steps each, as they bend: always a new factor, against the two deciders."""
    turns = [load + part for load in np.arange(5) * 0.2 for part in (0.1, 0.17, 0.195, 0.2)]
    systems = [bar.matrix(0.48, x=bar.bent(turn)) for turn in turns]
    b = np.random.default_rng(0).normal(size=systems[0].shape[0])
    figures: Figures = {}
    start = time.perf_counter()
    factor: Factor = CLASSES[next(name for name in CLASSES if PRESENT[name]())](systems[0], True, np.inf)
    factor.solve(b)
    for matrix in systems[1:]:
        factor.refactorise(matrix)
        factor.solve(b)
    figures["sequence_always_refactorise"] = {"value": time.perf_counter() - start, "unit": "s"}
    for name, by_clock in (("model", False), ("clock", True)):
        sequence = SystemSequence(by_clock=by_clock, memory_limit=np.inf)
        start = time.perf_counter()
        for matrix in systems:
            sequence.solve(matrix, b, tolerance=1e-3)
        figures[f"sequence_by_{name}"] = {"value": time.perf_counter() - start, "unit": "s"}
        figures[f"sequence_by_{name}_factorisations"] = {"value": sequence.factorisations, "unit": "1"}
        figures[f"sequence_by_{name}_iterations"] = {"value": sequence.cg_iterations, "unit": "1"}
    return figures


def _seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
