"""Rows of the table: what came of a case, and whether that is right."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field
from functools import reduce

from benchmarks.layered.case import Case, Outcome
from benchmarks.layered.measures import Measured, change, measured, skin_of
from benchmarks.layered.subject import Subject
from handpipe.core import HandpipeError

log = logging.getLogger(__name__)

BALANCED = 1e-2  # of the forces on a vertex; solvers are asked for 1e-3
POKING = 0.1  # mm of bone outside the skin
DEEP = 0.5  # mm of a muscle in a bone
RIGHT, REFUSED, WRONG = "right", "refused with reason", "WRONG"


@dataclass(frozen=True)
class Row:
    """What came of a case.

    said: what the library said: its refusal, or that contact has not settled; faults: in words; change: of
    the skin from the plain frame's in mm, mean and largest; checks: in words; seconds: the processor's.
    """

    case: str
    what: str
    verdict: str
    said: str
    faults: list[str]
    measures: Measured
    change: tuple[float, float] | None
    checks: list[str]
    seconds: float
    values: dict[str, float] = field(default_factory=dict)


def judged(case: Case, subject: Subject) -> Row:
    """Run a case; an exception that is not meant for people is a fault."""
    begun = time.process_time()
    try:
        outcome = case.run(subject)
    except HandpipeError as error:
        said = " ".join(str(error).split())
        return _row(case, begun, said=said, faults=_of_refusal(case, said), verdict=REFUSED)
    except Exception as error:
        log.exception("%s", case.name)
        return _row(case, begun, said="", faults=[f"{type(error).__name__}: {error}"])
    seconds = time.process_time() - begun
    return _of_outcome(case, outcome, subject, seconds)


def _row(case: Case, begun: float, said: str, faults: list[str], verdict: str = WRONG) -> Row:
    seconds = time.process_time() - begun
    row = Row(case.name, case.what, WRONG if faults else verdict, said, faults, Measured(), None, [], seconds)
    log.info("%s: %s %s %s, %.1f s", row.case, row.verdict, "; ".join(row.faults), row.said, row.seconds)
    return row


def _of_refusal(case: Case, said: str) -> list[str]:
    if case.named is None:
        return ["refused, though there is a result"]
    return [] if case.named in said else [f"the refusal does not name {case.named}"]


def _of_outcome(case: Case, outcome: Outcome, subject: Subject, seconds: float) -> Row:
    found = reduce(
        Measured.worse, [measured(s.frame, s.layers, s.shapes) for s in outcome.frames], Measured()
    )
    faults = [*wrong_in(found), *(str(c) for c in outcome.checks if not c.met)]
    if case.named:
        faults = ["not refused", *faults]
    moved = None
    if outcome.same_pose and skin_of(outcome.frames[0].shapes) is not None:
        away = change(outcome.frames[0].shapes, subject.plain_shapes)
        moved = (float(away.mean()), float(away.max()))
    row = Row(
        case.name,
        case.what,
        WRONG if faults else RIGHT,
        "contact has not settled" if found.unsettled else "",
        faults,
        found,
        moved,
        [str(c) for c in outcome.checks],
        seconds,
        {c.what: c.value for c in outcome.checks},
    )
    log.info(
        "%s: %s %s, %.1f s, %s, %s", row.case, row.verdict, "; ".join(faults), seconds, row.checks, found
    )
    return row


def wrong_in(found: Measured) -> list[str]:
    """What is wrong with frames that were handed on, in words."""
    faults = []
    if found.inverted or not found.least_det > 0:
        faults.append(f"{found.inverted} inverted tets")
    if found.unbalanced is not None and not found.unbalanced <= BALANCED:
        faults.append(f"a force of {found.unbalanced:.2g} of those on its vertex is left")
    if found.bones_outside is not None and not found.bones_outside <= POKING:
        faults.append(f"a bone {found.bones_outside:.2g} mm outside the skin")
    if found.muscles_in_bones is not None and not found.muscles_in_bones <= DEEP:
        faults.append(f"a muscle {found.muscles_in_bones:.2g} mm in a bone")
    return faults
