"""How the time of one equilibrium grows with the number of unknowns, and which part of it grows how."""

from __future__ import annotations

import logging
import time

import numpy as np

from benchmarks.fem.machine import REPEATS, Figures, figure, median_seconds, watched
from benchmarks.fem.scenes import box, turned
from handpipe.core import Array
from handpipe.fem.elements import Material
from handpipe.fem.linear import factorise
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Options, Steps, continuation

log = logging.getLogger(__name__)

CELLS = (8, 11, 14, 18, 22, 27)  # across a block 2 x 1 x 1: 6,144 to 236,196 tets
LARGE = 20  # cells across, from where each size is solved once
MATERIAL = Material(young=6.0, poisson=0.48)
TURN = 40.0  # degrees between the two ends
OPTIONS = Options(name="block")
PARTS = {  # measure -> unit; each is fitted by a power of the number of unknowns
    "seconds": "s",
    "hessian_seconds": "s",
    "analyse_seconds": "s",
    "factorise_seconds": "s",
    "back_substitution_seconds": "s",
    "factor_flops": "1",
    "factor_entries": "1",
}
# Theory for a direct solver of a 3D mesh ordered by nested dissection.
THEORY = {"factor_flops": 2.0, "factor_entries": 4 / 3, "hessian_seconds": 1.0}


def measure(cells: tuple[int, ...] = CELLS, repeats: int = REPEATS) -> Figures:
    """Figures `scaling_{measure}_{tets}`, their exponents, and `cost_exponent`, that of the whole time."""
    _one(2, 1)  # compiles
    rows = [_one(n, repeats if n < LARGE else 1) for n in cells]
    figures: Figures = {}
    for row in rows:
        tets = int(row["tets"])
        figures |= {
            f"scaling_{name}_{tets}": figure(value, PARTS.get(name, "1"))
            for name, value in row.items()
            if name != "tets"
        }
    unknowns = np.array([row["unknowns"] for row in rows])
    for name in PARTS:
        power = exponent(unknowns, np.array([row[name] for row in rows]))
        figures[f"exponent_{name}"] = figure(power, "1")
    figures["cost_exponent"] = figures.pop("exponent_seconds")
    largest = slice(-3, None)
    figures["cost_exponent_largest"] = figure(
        exponent(unknowns[largest], np.array([row["seconds"] for row in rows])[largest]), "1"
    )
    return figures | {f"exponent_theory_{name}": figure(value, "1") for name, value in THEORY.items()}


def exponent(unknowns: Array, values: Array) -> float:
    """Slope of the best line through logarithms: values grow as unknowns to this power."""
    return float(np.polyfit(np.log(unknowns), np.log(values), 1)[0])


def _one(n: int, repeats: int) -> dict[str, float]:
    """Time split of a block with n cells across: of one equilibrium, and of single pieces of work."""
    body = box((2.0, 1.0, 1.0), (2 * n, n, n))
    x, right = body.vertices, body.where(0, 1.0)
    clamped = np.repeat(right | body.where(0, -1.0), 3)
    elastic = Elastic(x, body.tets, MATERIAL)
    runs = []
    for _ in range(repeats):
        begun = time.perf_counter()
        with watched() as linear:
            found = continuation(
                lambda t: [elastic],
                x,
                fixed=clamped,
                prescribed=lambda t: turned(x, right, (1.0, 0.0, 0.0), TURN * t),
                options=OPTIONS,
                steps=Steps(first=1.0),
            )
        runs.append((time.perf_counter() - begun, found.record, linear))
    runs.sort(key=lambda run: run[0])
    seconds, record, linear = runs[len(runs) // 2]
    matrix = FreeBlock(elastic.hessian(x), ~clamped).matrix(elastic.hessian(x))
    first = median_seconds(lambda: factorise(matrix), repeats)
    factor = factorise(matrix)
    numeric = median_seconds(lambda: factor.refactorise(matrix), repeats)
    force = np.random.default_rng(0).normal(size=matrix.shape[0])
    log.info("%d tets: %.2f s, %d Newton steps", len(body.tets), seconds, record.iterations)
    return {
        "tets": len(body.tets),
        "unknowns": matrix.shape[0],
        "seconds": seconds,
        "share_linear": linear.seconds / seconds,
        "share_assembly": record.seconds["assembly"] / seconds,
        "share_search": record.seconds["search"] / seconds,
        "newton_steps": record.iterations,
        "factorisations": linear.factorisations,
        "cg_iterations": linear.cg_iterations,
        "hessian_seconds": median_seconds(lambda: elastic.hessian(x), repeats),
        "analyse_seconds": max(first - numeric, 1e-6),
        "factorise_seconds": numeric,
        "back_substitution_seconds": median_seconds(lambda: factor.solve(force), repeats),
        "factor_flops": factor.work.flops,
        "factor_entries": factor.work.entries,
    }
