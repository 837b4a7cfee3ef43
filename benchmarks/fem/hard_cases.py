"""Runs the hard cases of the equilibrium solver: `python -m benchmarks.fem.hard_cases [case ...]`.

Prints the table, writes it between the markers of docs/hard-cases.md (unless only some cases were asked
for), the rows as JSON and the shapes as a picture. Every judgement is made here from the final positions;
of the solver's record only counts and its claim to have converged are taken.
"""

from __future__ import annotations

import argparse
import json
import logging
import re
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import igl
import ipctk
import numpy as np
import scipy.sparse as sp

from benchmarks.fem.cases import CASES, Case, Outcome
from benchmarks.fem.hard_case_pictures import draw
from handpipe.core import Array, IntArray
from handpipe.fem.linear import NotPositiveDefinite, SingularMatrix, factorise

log = logging.getLogger(__name__)

CHECKOUT = Path(__file__).parents[2]
DOCUMENT = CHECKOUT / "docs" / "hard-cases.md"
BEGIN, END = "<!-- table: python -m benchmarks.fem.hard_cases -->", "<!-- end of table -->"
RESIDUAL = 1e-4  # of the characteristic force


@dataclass(frozen=True)
class Row:
    """What came of a case; numbers are None where an exception left nothing to measure.

    iterations count those on a compressible stand-in, too; seconds are the processor's.
    least_elastic, least_total: smallest det F_e and det F of all tets. residual: largest force on a free
    vertex over the characteristic force. minimum: whether the stiffness is positive definite.
    overlapping: tets whose middle is inside the surface more than once. failures: what is wrong, if anything.
    """

    case: str
    what: str
    tets: int | None
    converged: bool
    reason: str
    iterations: int | None
    factorisations: int | None
    least_elastic: float | None
    least_total: float | None
    residual: float | None
    minimum: bool | None
    intersecting: bool | None
    overlapping: int | None
    error: float | None
    tolerance: float | None
    answer: str
    seconds: float
    failures: list[str]


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    """Raises `TimeoutError` inside the block after so many seconds of processor time."""

    def stop(number: int, frame: object) -> None:
        raise TimeoutError(f"not done after {seconds} s of processor time")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def run(case: Case, refine: int = 1, limit: int = 60) -> tuple[Row, Outcome | None]:
    """Solve a case in at most `limit` seconds of the processor and judge it; an exception is a failed row."""
    start = time.process_time()
    try:
        with limited(limit):
            outcome = case.run(refine)
    except Exception as error:
        log.exception("%s", case.name)
        seconds = time.process_time() - start
        reason = f"{type(error).__name__}: {error}"
        nothing = (None,) * 9
        return Row(case.name, case.what, None, False, reason, *nothing, None, "", seconds, [reason]), None
    return judge(case, outcome, time.process_time() - start), outcome


def judge(case: Case, outcome: Outcome, seconds: float) -> Row:
    """Measure the final state, and say what is wrong with it."""
    x, record, elastic = outcome.x, outcome.record, outcome.elastic
    least_elastic = float(np.linalg.det(elastic.elastic_gradients(x)).min())
    least_total = float(np.linalg.det(elastic.deformation_gradients(x)).min())
    residual = relative_residual(outcome)
    intersecting, overlapping = surfaces_meet(x, outcome.triangles), overlapping_tets(outcome)
    minimum = is_minimum(outcome)
    converged = record.converged and not record.reason.startswith("stopped")
    checks = [
        (converged, f"not converged: {record.reason}"),
        (least_total > 0, "inverted elements"),
        (minimum, "no minimum"),
        (residual <= RESIDUAL, f"residual {residual:.1e} of the characteristic force"),
        (not intersecting and overlapping == 0, "penetration"),
        (
            outcome.error is None or outcome.error <= outcome.tolerance,
            f"{outcome.error or 0.0:.2g} mm from the known answer ({outcome.answer})",
        ),
    ]
    return Row(
        case=case.name,
        what=case.what,
        tets=len(elastic.tets),
        converged=converged,
        reason=record.reason,
        iterations=record.iterations + record.untangled,
        factorisations=record.factorisations,
        least_elastic=least_elastic,
        least_total=least_total,
        residual=residual,
        minimum=minimum,
        intersecting=intersecting,
        overlapping=overlapping,
        error=outcome.error,
        tolerance=outcome.tolerance,
        answer=outcome.answer,
        seconds=seconds,
        failures=[text for good, text in checks if not good],
    )


def relative_residual(outcome: Outcome) -> float:
    """Largest force on a free vertex over the characteristic force.

    That is the largest force that any potential puts on a vertex, or what it takes to stretch the softest
    material by its own length over the cross-section that belongs to a vertex, if that is more.
    """
    parts = [p.gradient(outcome.x) for p in outcome.potentials]
    elastic = outcome.elastic
    share = elastic.volumes.sum() / len(np.unique(elastic.tets))
    softest = float(np.min(elastic.material.young))
    characteristic = max(softest * share ** (2 / 3), *(np.linalg.norm(p, axis=1).max() for p in parts))
    force = np.where(outcome.free.reshape(-1, 3), np.sum(parts, axis=0), 0.0)
    return float(np.linalg.norm(force, axis=1).max() / characteristic)


def is_minimum(outcome: Outcome) -> bool:
    """Whether the stiffness of the free degrees of freedom is positive definite."""
    total = sum(p.hessian(outcome.x) for p in outcome.potentials)
    free = sp.csr_matrix(total)[outcome.free][:, outcome.free]
    try:
        factorise(sp.csr_matrix(free), positive=True)
    except (NotPositiveDefinite, SingularMatrix):
        return False
    return True


def surfaces_meet(x: Array, triangles: IntArray) -> bool:
    """Whether an edge of the surface passes through a triangle of it."""
    used, faces = np.unique(triangles, return_inverse=True)
    faces = np.asfortranarray(faces.reshape(-1, 3), dtype=np.int32)
    points = np.asfortranarray(x[used])
    return bool(ipctk.has_intersections(ipctk.CollisionMesh(points, ipctk.edges(faces), faces), points))


def overlapping_tets(outcome: Outcome) -> int:
    """Tets whose middle is inside the surface more than once, which also finds bodies inside bodies."""
    middles = outcome.x[outcome.elastic.tets].mean(axis=1)
    winding = igl.fast_winding_number(outcome.x, outcome.triangles, middles)
    return int((np.asarray(winding) > 1.5).sum())


COLUMNS = (
    "case", "result", "iterations", "factorisations", "least det F_e", "least det F", "residual", "minimum",
    "penetration", "error (mm)", "known answer", "seconds",
)  # fmt: skip


def cells(row: Row) -> list[str]:
    """A row as text."""

    def number(value: float | None, spec: str) -> str:
        return "" if value is None else format(value, spec)

    met = row.intersecting or (row.overlapping or 0) > 0
    return [
        f"`{row.case}`: {row.what}",
        "good" if not row.failures else "**fails**: " + "; ".join(row.failures).replace("|", "/"),
        number(row.iterations, "d"),
        number(row.factorisations, "d"),
        number(row.least_elastic, ".2g"),
        number(row.least_total, ".2g"),
        number(row.residual, ".0e"),
        "" if row.minimum is None else ("yes" if row.minimum else "no"),
        "" if row.intersecting is None else ("yes" if met else "none"),
        number(row.error, ".1e"),
        row.answer,
        number(row.seconds, ".1f"),
    ]


def table(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    good = sum(not row.failures for row in rows)
    lines = [f"{good} of {len(rows)} are good.", "", "| " + " | ".join(COLUMNS) + " |"]
    lines.append("|" + " --- |" * len(COLUMNS))
    return "\n".join(lines + ["| " + " | ".join(cells(row)) + " |" for row in rows])


def write_document(rows: Sequence[Row]) -> None:
    """Put the table between the markers of the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    replacement = f"{BEGIN}\n\n{table(rows)}\n\n{END}"
    DOCUMENT.write_text(pattern.sub(lambda _: replacement, text), encoding="utf-8")


def measure() -> dict[str, dict[str, object]]:
    """Figures of the table: how many cases there are, how many are good, and the processor's seconds."""
    run(CASES["two-bodies"])
    rows = [run(case)[0] for case in CASES.values()]
    return {
        "hard_cases": {"value": len(rows), "unit": "1"},
        "hard_cases_good": {"value": sum(not row.failures for row in rows), "unit": "1"},
        "hard_cases_seconds": {"value": sum(row.seconds for row in rows), "unit": "s"},
    }


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Hard cases of the equilibrium solver")
    parser.add_argument("cases", nargs="*", help="names; all, and the document's table, if none is given")
    parser.add_argument("--refine", type=int, default=1, help="divide edges by this")
    parser.add_argument("--limit", type=int, default=60, help="seconds of processor time a case may take")
    parser.add_argument("--json", type=Path, default=Path("results/benchmarks/hard_cases.json"))
    parser.add_argument("--picture", type=Path, default=Path("results/benchmarks/hard_cases.png"))
    given = parser.parse_args(arguments)
    run(CASES["two-bodies"])  # compiles what the first case would have to wait for
    rows, outcomes = [], []
    for name in given.cases or CASES:
        row, outcome = run(CASES[name], given.refine, given.limit)
        rows.append(row)
        outcomes.append(outcome)
        print(" | ".join(cells(row)), flush=True)
    for path in (given.json, given.picture):
        path.parent.mkdir(parents=True, exist_ok=True)
    given.json.write_text(json.dumps([asdict(row) for row in rows], indent=1), encoding="utf-8")
    draw([row.case for row in rows], [not row.failures for row in rows], outcomes, given.picture)
    if not given.cases and given.refine == 1:
        write_document(rows)


if __name__ == "__main__":
    main()
