"""Spaces of plastic strains for a search, and its states, stages and steps.

A strain space turns unknowns into the log-strains of all tets, has a prior on them, and computes the
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
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.correspondence import Correspondence

FindMarks = Callable[[Array], Correspondence]


@dataclass(frozen=True)
class State:
    """A state of the search: strains, and the equilibrium under them.

    Attributes
    ----------
    unknowns : (k, 6)
        Unknowns of a strain space.
    attachments : AttachmentTargets
        Attached points and loose ends of the body.
    body : Elastic
        The body under the strains.
    x : (n, 3)
        Its equilibrium.
    tangles : int
        The tangled tets of that equilibrium.
    """

    unknowns: Array
    attachments: AttachmentTargets
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
    """A step of the search: changes of the unknowns and of the positions.

    Attributes
    ----------
    strains : (k, 6)
        Change of the unknowns.
    motion : (n, 3)
        Change of the positions to first order.
    slope : float
        The objective's slope along the step.
    ends : (6 e,)
        Change of loose ends.
    loose : (r,)
        Change of the rigid motions that attachments leave free.
    iterations : int
        Iterations that the step took (0: solved directly).
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
        """Twice the prior's part of the objective."""
        ...

    def step(self, state: State, external: Sequence[Potential], marks: Correspondence, stage: Stage) -> Step:
        """The Gauss-Newton step of a stage from a state under `external` potentials and the body's own."""
        ...
