"""A hard case of the layered simulation, and what comes of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from benchmarks.layered.subject import Subject, simulated
from handpipe.core import Frame, Layer, Shapes


@dataclass(frozen=True)
class Check:
    """A condition that does not depend on the solver: `value` is at most `limit`."""

    what: str
    value: float
    limit: float
    unit: str = "mm"

    @property
    def met(self) -> bool:
        """Whether it is; NaN is not."""
        return self.value <= self.limit

    def __str__(self) -> str:
        """What is measured, and its value against the limit."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.what} {self.value:.3g} of {self.limit:.3g}{unit}"


@dataclass(frozen=True)
class Solved:
    """A frame, the layers it was simulated with, and its shapes by layer and body."""

    frame: Frame
    layers: Sequence[Layer]
    shapes: dict[str, Shapes]

    @staticmethod
    def of(frame: Frame, layers: Iterable[Layer]) -> Solved:
        """The frame, simulated."""
        given = list(layers)
        return Solved(frame, given, simulated(frame, given))


@dataclass(frozen=True)
class Outcome:
    """Frames that were handed on; the first one's skin is compared with the plain frame's if `same_pose`."""

    frames: Sequence[Solved]
    checks: Sequence[Check] = field(default_factory=list)
    same_pose: bool = True


@dataclass(frozen=True)
class Case:
    """A hard case.

    named: words that a refusal must contain; None where the case has a result, empty where a refusal and a
    result are both right.
    """

    name: str
    what: str
    run: Callable[[Subject], Outcome]
    named: str | None = None


def by_name(cases: Iterable[Case]) -> dict[str, Case]:
    """Cases by name; each name once."""
    given = list(cases)
    found = {case.name: case for case in given}
    if len(found) != len(given):
        raise ValueError("two cases have one name")
    return found
