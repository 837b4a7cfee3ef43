"""Long tables of cases: a part of each is always tested, all of it by `make test-all`."""

from collections.abc import Iterable

import pytest


def every(step: int, cases: Iterable[object]) -> list[object]:
    """Cases for `parametrize`, of one argument: each `step`-th is always tested, the others are slow."""
    return [
        pytest.param(case, marks=() if number % step == 0 else pytest.mark.slow)
        for number, case in enumerate(cases)
    ]
