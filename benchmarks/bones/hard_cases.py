"""Judges the hard cases of the bones, each against the phantom's truth alone."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.bones.cases import CASES, Case, Place
from benchmarks.bones.outcome import BoneErrors, Outcome, run
from benchmarks.bones.subject import NEUTRAL, PHALANGES, Part

log = logging.getLogger(__name__)

Pair = tuple[float, float]
"""deg and mm."""


@dataclass(frozen=True)
class Bars:
    """What is asked of a bone in a pose, and of the means; deg and mm."""

    dice_mean: float = 0.97
    dice_min: float = 0.93
    motion_mean: Pair = (0.3, 0.1)
    motion_max: Pair = (1.5, 0.5)
    fitted: Pair = (0.5, 0.15)
    left_out: Pair | None = (1.2, 0.35)  # not asked for where poses are too few
    deviations: float = 2.5  # stated ones, within which an error is expected
    alarms: float = 0.1  # false ones, as a share of all bones

    def met_by(self, errors: BoneErrors) -> bool:
        """Whether a bone in a pose is right, as far as it was found."""
        turned, moved = self.motion_max
        return (
            (errors.dice is None or errors.dice >= self.dice_min)
            and (errors.rotation is None or errors.rotation <= turned)
            and (errors.translation is None or errors.translation <= moved)
        )

    def expected(self, errors: BoneErrors) -> bool:
        """Whether a registration says itself that it may be so far off; its bone is well segmented."""
        if errors.stated is None or errors.rotation is None or errors.translation is None:
            return False
        turned, moved = errors.stated
        well = errors.dice is not None and errors.dice >= self.dice_min
        return (
            well
            and errors.rotation <= self.deviations * turned
            and errors.translation <= max(self.deviations * moved, self.motion_max[1])
        )


BARS = Bars()


@dataclass(frozen=True)
class Row:
    """What came of a case. Pairs are (deg, mm); means and extremes are over what was passed on to the rig.

    bones: those asked for, in all poses; wrong: those beyond the bars or not found, in words; noticed: how
    many of these the library spoke of; alarms: how many right ones it spoke of; said: its words; fitted,
    left_out: mean errors of the rig; failures: what is wrong, if anything.
    """

    case: str
    what: str
    bones: int
    dice: tuple[float, float] | None
    motion_mean: Pair | None
    motion_max: Pair | None
    fitted: Pair | None
    left_out: Pair | None
    wrong: list[str]
    noticed: int
    alarms: int
    said: list[str]
    seconds: float
    failures: list[str]


def judge(case: Case, outcome: Outcome, bars: Bars = BARS) -> Row:
    """Compare an outcome with the bars; an error that is noticed and kept from the rig is none."""
    errors, said = outcome.errors, {place for place, texts in outcome.said.items() if texts}
    wrong = {place for place, e in errors.items() if not bars.met_by(e)}
    expected = {place for place in wrong if bars.expected(errors[place])}
    wrong |= {place for place in outcome.left_out if place[0] != NEUTRAL and errors[place].rotation is None}
    kept = {place: e for place, e in errors.items() if place not in outcome.left_out}
    dice = [e.dice for e in kept.values() if e.dice is not None]
    motions = [
        (e.rotation, e.translation)
        for e in kept.values()
        if e.rotation is not None and e.translation is not None
    ]
    row = Row(
        case=case.name,
        what=case.what,
        bones=len(errors),
        dice=(float(np.mean(dice)), min(dice)) if dice else None,
        motion_mean=_pair(np.mean(motions, axis=0)) if motions else None,
        motion_max=_pair(np.max(motions, axis=0)) if motions else None,
        fitted=_of_rig(outcome, ""),
        left_out=_of_rig(outcome, "loo_"),
        wrong=[described(place, errors[place]) for place in sorted(wrong)],
        noticed=len(wrong & (said | expected)),
        alarms=len((said & set(errors)) - wrong),
        said=[f"{pose}: {text}" for (pose, _), texts in outcome.said.items() for text in texts]
        + [f"rig: {text}" for text in outcome.rig_said],
        seconds=outcome.seconds,
        failures=[],
    )
    return replace(
        row,
        failures=failures(row, wrong - said - expected, (wrong - expected) & set(kept) & said, errors, bars),
    )


def failures(
    row: Row, unnoticed: set[Place], passed_on: set[Place], errors: Mapping[Place, BoneErrors], bars: Bars
) -> list[str]:
    """What is wrong with a case, in words."""
    found = [f"not noticed: {described(p, errors[p])}" for p in sorted(unnoticed)]
    found += [f"noticed and passed on: {described(p, errors[p])}" for p in sorted(passed_on)]
    if row.dice is None or row.dice[0] < bars.dice_mean:
        found.append(f"mean Dice below {bars.dice_mean:g}")
    for name, pair, bar in (
        ("registration", row.motion_mean, bars.motion_mean),
        ("fitted rig", row.fitted, bars.fitted),
        ("left-out poses", row.left_out, bars.left_out),
    ):
        if bar is None:
            continue
        if pair is None:
            found.append(f"no {name}")
        elif pair[0] > bar[0] or pair[1] > bar[1]:
            found.append(f"{name} above {bar[0]:g} deg, {bar[1]:g} mm")
    if row.alarms > bars.alarms * row.bones:
        found.append(f"{row.alarms} false alarms")
    return found


def described(place: Place, errors: BoneErrors) -> str:
    """A bone in a pose and its errors, in words."""
    pose, bone = place
    dice = "not found" if errors.dice is None else f"Dice {errors.dice:.2f}"
    if errors.rotation is None:
        return f"{bone} in {pose} ({dice})"
    return f"{bone} in {pose} ({dice}, {errors.rotation:.1f} deg, {errors.translation:.1f} mm)"


def _pair(values: NDArray) -> Pair:
    return float(values[0]), float(values[1])


def _of_rig(outcome: Outcome, prefix: str) -> Pair | None:
    names = [f"{prefix}{kind}_error_mean" for kind in ("rotation", "translation")]
    if any(name not in outcome.rig for name in names):
        return None
    return outcome.rig[names[0]][0], outcome.rig[names[1]][0]


COLUMNS = (
    "case", "result", "Dice mean / min", "registration mean", "max", "rig, fitted", "left out",
    "wrong, noticed", "false alarms", "seconds",
)  # fmt: skip


def cells(row: Row) -> list[str]:
    """A row as text."""

    def pair(values: Pair | None) -> str:
        return "" if values is None else f"{values[0]:.2f} deg, {values[1]:.2f} mm"

    return [
        f"`{row.case}`: {row.what}",
        "good" if not row.failures else "**fails**: " + "; ".join(row.failures),
        "" if row.dice is None else f"{row.dice[0]:.3f} / {row.dice[1]:.3f}",
        pair(row.motion_mean),
        pair(row.motion_max),
        pair(row.fitted),
        pair(row.left_out),
        f"{len(row.wrong)}, {row.noticed} of {row.bones}",
        str(row.alarms),
        f"{row.seconds:.0f}",
    ]


def table(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table, and what the library said of the bones that went wrong."""
    good = sum(not row.failures for row in rows)
    lines = [f"{good} of {len(rows)} are good.", "", "| " + " | ".join(COLUMNS) + " |"]
    lines.append("|" + " --- |" * len(COLUMNS))
    lines += ["| " + " | ".join(c.replace("|", "/") for c in cells(row)) + " |" for row in rows]
    return "\n".join(lines)


def measure(name: str, part: Part = PHALANGES, bars: Bars = BARS) -> Row:
    """The row of a case, on a part of the hand; by default the phalanges of the index finger.

    An exception that is not meant for people is a failed row.
    """
    case = CASES[name]
    begun = time.process_time()
    try:
        row = judge(case, run(case, part), bars)
    except Exception as error:
        log.exception("%s", name)
        reason = f"{type(error).__name__}: {error}"
        nothing = (None,) * 5
        row = Row(name, case.what, 0, *nothing, [], 0, 0, [], time.process_time() - begun, [reason])
    log.info("%s", " | ".join(cells(row)))
    return row
