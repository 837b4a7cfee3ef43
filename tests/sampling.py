"""Long tables of cases: a part of each is always tested, all of it by `make test-all`."""

from collections.abc import Hashable, Iterable, Mapping

import pytest


def every(
    step: int, cases: Iterable[Hashable], marks: Mapping[Hashable, pytest.MarkDecorator] | None = None
) -> list[object]:
    """Cases for `parametrize`, of one argument: each `step`-th is always tested, the others are slow.

    marks: what a case has besides.
    """
    found = []
    for number, case in enumerate(cases):
        own = [marks[case]] if marks and case in marks else []
        found.append(pytest.param(case, marks=own if number % step == 0 else [*own, pytest.mark.slow]))
    return found
