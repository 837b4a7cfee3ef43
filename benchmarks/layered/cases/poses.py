"""Poses: at limits, beyond the scans, and scanned ones against the truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.layered.case import Case, Check, Outcome, Solved
from benchmarks.layered.measures import distances, skin_of
from benchmarks.layered.subject import PLAIN, Subject
from handpipe.skeleton.joints.angles import Angles

STILL = 0.01  # mm
NEAR = {"fist": 0.3, "half": 0.5}  # mm, mean distance of the true skin: an example, a held-out pose


def _posed(angles: Callable[[Subject], Angles], same: bool = False) -> Callable[[Subject], Outcome]:
    def run(subject: Subject) -> Outcome:
        frame = subject.frame("case", angles(subject))
        return Outcome([Solved.of(frame, subject.whole())], same_pose=same)

    return run


def _opposed(first: float, others: float) -> Callable[[Subject], Angles]:
    """The first flexion at one limit, all others at another."""

    def angles(subject: Subject) -> Angles:
        name = next(n for n in subject.limits if n.endswith("flexion"))
        return subject.bent(others, **{name: first})

    return angles


def _rest(subject: Subject) -> Outcome:
    found = Solved.of(subject.frame("case", subject.bent(0.0)), subject.whole())
    skin = skin_of(found.shapes)
    assert skin is not None
    moved = float(np.linalg.norm(skin.vertices - skin.rest, axis=1).max())
    return Outcome([found], [Check("skin from the neutral skin", moved, STILL)], same_pose=False)


def _true(pose: str) -> Callable[[Subject], Outcome]:
    def run(subject: Subject) -> Outcome:
        found = Solved.of(subject.frame("case", subject.scanned[pose]), subject.whole())
        skin = skin_of(found.shapes)
        assert skin is not None
        error = distances(subject.skins[pose].vertices, skin.vertices, skin.cells)
        check = Check("true skin from the skin, mean", float(error.mean()), NEAR[pose])
        return Outcome([found], [check], same_pose=False)

    return run


CASES = [
    Case("plain", "every flexion at 0.45 of its limit", _posed(lambda s: s.bent(PLAIN), same=True)),
    Case("rest", "neutral, all layers", _rest),
    Case("clenched", "every flexion at its upper limit", _posed(lambda s: s.bent(1.0))),
    Case("hyperextended", "every flexion at its lower limit", _posed(lambda s: s.bent(-1.0))),
    Case("abducted", "plain, abduction at its upper limit", _posed(lambda s: s.bent(PLAIN, 1.0))),
    Case("adducted", "plain, abduction at its lower limit", _posed(lambda s: s.bent(PLAIN, -1.0))),
    Case("claw", "first joint hyperextended, the others clenched", _posed(_opposed(-1.0, 1.0))),
    Case("tabletop", "first joint bent to its limit, the others hyperextended", _posed(_opposed(1.0, -1.0))),
    Case("corner", "clenched and abducted to all limits", _posed(lambda s: s.bent(1.0, 1.0))),
    Case("example", "a scanned example, the fist, against its true skin", _true("fist")),
    Case("held-out", "a scanned pose that nothing was fitted to, against its true skin", _true("half")),
]
