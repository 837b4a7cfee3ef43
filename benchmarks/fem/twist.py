"""A beam 4 x 1 x 1 with fixed ends, one turned by 180 degrees: against scikit-fem and pypardiso."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.fem import skfem_newton
from benchmarks.fem.machine import REPEATS, Figures, LinearWatch, figure, watched
from benchmarks.fem.scenes import Body, grid, turned
from handpipe.core import Array, BoolArray
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Options, Steps, continuation, solve
from handpipe.fem.solver.equilibrium import Record

log = logging.getLogger(__name__)

YOUNG, POISSON = 1.0, 0.45
TURN, STEPS = 180.0, 12
TOLERANCE = 1e-8  # of |g|, the norm of all free forces, in units of E times an area of 1
LARGE = 30_000  # tets, from where each scene is run once
SIZES = {"5k": 6, "24k": 10, "66k": 14}  # cells across the beam: 5,184, 24,000 and 65,856 tets
# The solver's tolerances are those of the state before its last step, relative to the largest force at hand.
# `TOLERANCE` is checked afterwards, at the end of each of the twelve steps.
OPTIONS = Options(displacement_tolerance=1e-2, force_tolerance=1e-3, name="twist")


class Watched(Elastic):
    """A body that remembers the last shape whose energy was asked for: the end of a step."""

    last: Array

    def value(self, x: Array) -> float:
        self.last = x
        return super().value(x)


@dataclass(frozen=True)
class Beam:
    """The beam with its clamped vertices (n,) and where those are when the turn has come to a share t."""

    body: Body
    clamped: BoolArray

    @staticmethod
    def build(cells: int) -> Beam:
        """The beam with `cells` cells of six tets across it and four times as many along it."""
        across = np.linspace(0.0, 1.0, cells + 1)
        body = grid(np.linspace(0.0, 4.0, 4 * cells + 1), across, across)
        return Beam(body, body.where(0, 0.0) | body.where(0, 4.0))

    def ends(self, t: float) -> Array:
        """Positions (n, 3) of which those of the clamped vertices count."""
        x = self.body.vertices
        return turned(x, self.body.where(0, 4.0), (1.0, 0.0, 0.0), TURN * t, (0.0, 0.5, 0.5))


@dataclass
class Run:
    """One run of ours: positions, what the solver did, seconds in all, the watched linear solver.

    `residual` is the largest |g| at the end of a step.
    """

    x: Array
    record: Record
    seconds: float
    linear: LinearWatch
    residual: float


def measure(sizes: dict[str, int] | None = None, repeats: int = REPEATS) -> Figures:
    """Figures `twist_…_{size}` for each size (name: cells across), and of the same turn in one step."""
    sizes = SIZES if sizes is None else sizes
    ours(Beam.build(2))  # compiles
    figures: Figures = {}
    for name, cells in sizes.items():
        beam = Beam.build(cells)
        times = repeats if len(beam.body.tets) < LARGE else 1  # the reference takes minutes there
        figures |= _compared(name, beam, times) | _one_step(name, beam, times)
    return figures


def ours(beam: Beam) -> Run:
    """Twelve steps by `continuation`, each from the tangent's prediction to the tolerance."""
    begun = time.perf_counter()
    body = Watched(beam.body.vertices, beam.body.tets, Material(YOUNG, POISSON))
    body.last = beam.body.vertices
    ends: list[Array] = []

    def prescribed(t: float) -> Array:
        ends.append(body.last)
        return beam.ends(t)

    with watched() as linear:
        found = continuation(
            lambda t: [body],
            beam.body.vertices,
            fixed=np.repeat(beam.clamped, 3),
            prescribed=prescribed,
            options=OPTIONS,
            steps=Steps(first=1 / STEPS, largest=1 / STEPS),
        )
    seconds = time.perf_counter() - begun
    residual = max(_residual(body, x, beam) for x in [*ends[1:], found.x])
    return Run(found.x, found.record, seconds, linear, residual)


def at_once(beam: Beam) -> Run:
    """The whole turn in one step, from the rest shape with its end turned."""
    begun = time.perf_counter()
    body = Elastic(beam.body.vertices, beam.body.tets, Material(YOUNG, POISSON))
    options = replace(OPTIONS, force_tolerance=1e-4, max_iterations=1000, allow_partial=True)
    with watched() as linear:
        found = solve([body], beam.ends(1.0), fixed=np.repeat(beam.clamped, 3), options=options)
    seconds = time.perf_counter() - begun
    return Run(found.x, found.record, seconds, linear, _residual(body, found.x, beam))


def reference(beam: Beam, threads: int = 2) -> tuple[skfem_newton.Solution, float]:
    """The same twelve steps by scikit-fem and pypardiso, and the seconds in all."""
    begun = time.perf_counter()
    material = skfem_newton.NeoHookean(YOUNG, POISSON)
    newton = skfem_newton.Reference(beam.body.vertices, beam.body.tets, beam.clamped, material, threads)
    found = newton.follow([beam.ends(i / STEPS) for i in range(1, STEPS + 1)], TOLERANCE)
    return found, time.perf_counter() - begun


def _residual(body: Elastic, x: Array, beam: Beam) -> float:
    return float(np.linalg.norm(body.gradient(x)[~beam.clamped]))


def _compared(name: str, beam: Beam, repeats: int) -> Figures:
    """Ours and the reference in turn, medians of the repeats."""
    reason = skfem_newton.missing()
    own, theirs = [], []
    for _ in range(repeats):
        own.append(ours(beam))
        log.info("twist %s: ours %.1f s, |g| = %.1e", name, own[-1].seconds, own[-1].residual)
        if reason is None:
            theirs.append(reference(beam))
            log.info("twist %s: reference %.1f s, %s", name, theirs[-1][1], theirs[-1][0].seconds)
    seconds = float(np.median([run.seconds for run in own]))
    linear = float(np.median([run.linear.seconds for run in own]))
    record, solver = own[0].record, own[0].linear
    figures: Figures = {
        f"twist_tets_{name}": figure(len(beam.body.tets), "1"),
        f"twist_unknowns_{name}": figure(int(3 * (~beam.clamped).sum()), "1"),
        f"twist_seconds_{name}": figure(seconds, "s"),
        f"twist_linear_seconds_{name}": figure(linear, "s"),
        f"twist_assembly_seconds_{name}": figure(
            float(np.median([run.record.seconds["assembly"] for run in own])), "s"
        ),
        f"twist_overhead_{name}": figure(
            float(np.median([run.seconds / run.linear.seconds for run in own])), "1"
        ),
        f"twist_newton_steps_{name}": figure(record.iterations, "1"),
        f"twist_factorisations_{name}": figure(solver.factorisations, "1"),
        f"twist_cg_iterations_{name}": figure(solver.cg_iterations, "1"),
        f"twist_residual_{name}": figure(max(run.residual for run in own), "E mm2"),
    }
    return figures | _against(name, own, theirs, reason)


def _against(
    name: str, own: list[Run], theirs: list[tuple[skfem_newton.Solution, float]], reason: str | None
) -> Figures:
    """The figures that need the reference; without a value and with the reason where it is absent."""
    if not theirs:
        keys = {"ratio_skfem": "1", "difference": "mm", "skfem_seconds": "s"}
        return {f"twist_{key}_{name}": figure(None, unit, reason) for key, unit in keys.items()}
    ratios = [seconds / run.seconds for run, (_, seconds) in zip(own, theirs, strict=True)]
    found = theirs[0][0]
    return {
        f"twist_ratio_skfem_{name}": figure(float(np.median(ratios)), "1"),
        f"twist_difference_{name}": figure(float(np.linalg.norm(own[0].x - found.x, axis=1).max()), "mm"),
        f"twist_skfem_seconds_{name}": figure(float(np.median([s for _, s in theirs])), "s"),
        f"twist_skfem_linear_seconds_{name}": figure(
            float(np.median([f.seconds["linear"] for f, _ in theirs])), "s"
        ),
        f"twist_skfem_assembly_seconds_{name}": figure(
            float(np.median([f.seconds["assembly"] for f, _ in theirs])), "s"
        ),
        f"twist_skfem_newton_steps_{name}": figure(found.steps, "1"),
        f"twist_skfem_residual_{name}": figure(found.residual, "E mm2"),
    }


def _one_step(name: str, beam: Beam, repeats: int) -> Figures:
    runs = [at_once(beam) for _ in range(repeats)]
    record = runs[0].record
    return {
        f"twist_one_step_converged_{name}": figure(float(all(r.record.converged for r in runs)), "1"),
        f"twist_one_step_seconds_{name}": figure(float(np.median([r.seconds for r in runs])), "s"),
        f"twist_one_step_newton_steps_{name}": figure(record.iterations, "1"),
        f"twist_one_step_factorisations_{name}": figure(runs[0].linear.factorisations, "1"),
        f"twist_one_step_tangles_{name}": figure(record.tangles, "1"),
        f"twist_one_step_residual_{name}": figure(max(r.residual for r in runs), "E mm2"),
    }
