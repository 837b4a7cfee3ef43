"""What a search for plastic strains chooses among, and what a step of it needs and gives.

A strain space turns unknowns into the log-strains of all tets, says which of them it prefers, and finds the
Gauss-Newton step (Wang 2021 Eq. 5.8) towards marks. There are two: the strains of every tet (`all_tets.py`),
and combinations of the smoothest strain fields (`smooth_fields.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from handpipe.core import Array
from handpipe.fem.potentials import Elastic, Potential
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.holds import Holds

FindMarks = Callable[[Array], Correspondence]


@dataclass(frozen=True)
class State:
    """Unknowns of a strain space (k, 6), what holds the body, the body under the strains, its equilibrium x
    (n, 3), and the tangled tets of that.
    """

    unknowns: Array
    holds: Holds
    body: Elastic
    x: Array
    tangles: int


@dataclass(frozen=True)
class Stage:
    """At most that many steps towards marks.

    find: the marks' places on a present shape; weight: 1/mm^2 of their squared errors; fields: how many of
    the smoothest strain fields may change (1: the uniform strains; None: all).
    """

    name: str
    find: FindMarks
    weight: float
    fields: int | None
    most: int


@dataclass(frozen=True)
class Step:
    """Change of the unknowns (k, 6), of the positions (n, 3) to first order, of loose ends (6 e,) and of the
    rigid motions (r,) that attachments leave free; the objective's slope along it, and the iterations that it
    took (0: solved directly).
    """

    strains: Array
    motion: Array
    slope: float
    ends: Array
    loose: Array
    iterations: int = 0


NOTHING = np.zeros(0)


class StrainSpace(Protocol):
    """Log-strains by unknowns (k, 6)."""

    def zero(self) -> Array:
        """Unknowns (k, 6) of no strain."""
        ...

    def logs(self, unknowns: Array) -> Array:
        """Log-strains (m, 6), linear in the unknowns."""
        ...

    def plastic(self, unknowns: Array) -> Array:
        """Plastic strains (m, 6) of the body from its rest shape on."""
        ...

    def prior(self, unknowns: Array) -> float:
        """Twice the energy that prefers some strains to others."""
        ...

    def step(self, state: State, held: Sequence[Potential], marks: Correspondence, stage: Stage) -> Step:
        """The Gauss-Newton step of a stage from a state that `held` potentials hold."""
        ...
