"""Weights and stopping criteria of searches."""

from __future__ import annotations

import math
from dataclasses import dataclass

from handpipe.core import InputError
from handpipe.fem.elements import Material

MUSCLE = Material(6.0, 0.48)  # kPa (Zheng 2022 Table 2)

# Of each number in `SearchSettings` and in what extends it.
RANGES: dict[str, tuple[float, float]] = {
    "alpha": (1e-6, 1e6),
    "beta": (1e-6, 1e6),
    "spring": (1e-6, 1e9),
    "tangential": (0.0, 1.0),
    "iterations": (0, 10_000),
    "enough": (0.0, 100.0),
    "progress": (0.0, 1.0),
    "mark_error": (1e-6, 100.0),
    "remesh_below": (0.0, 60.0),
}


@dataclass(frozen=True)
class SearchSettings:
    """Weights and stopping criteria of the search for a shape.

    Parameters
    ----------
    alpha, beta : float
        Weights of marks and attachments against smoothness in 1/mm^2 (Wang 2021 Eq. 5.3).
    spring : float
        Stiffness of an attached point in mN/mm.
    tangential : float
        Weight of a mark's squared error along the surface, relative to that along its normal.
    iterations : int
        Largest number of iterations at the full weight.
    enough : float
        Distance in mm of the farthest mark at which the search ends.
    progress : float
        Relative decrease of the objective below which a stage ends.
    resolution : pair of float, optional
        Least decreases in mm of the mean and the largest distance of marks in a step; a step with less of
        both ends the stage (None: no such limit).
    loose : float
        Weight in 1/mm^2 of the moves of loose ends from their first places.
    material : Material
        Material of the body.

    Raises
    ------
    InputError
        For a number that is out of `RANGES`.
    """

    alpha: float = 10.0
    beta: float = 10.0
    spring: float = 500.0
    tangential: float = 0.1
    iterations: int = 20
    enough: float = 0.05
    progress: float = 0.01
    resolution: tuple[float, float] | None = (0.002, 0.01)
    loose: float = 1e-3
    material: Material = MUSCLE

    def __post_init__(self) -> None:
        """Check that every number is within `RANGES`."""
        for name, (lower, upper) in RANGES.items():
            value = getattr(self, name, lower)
            if not (math.isfinite(value) and lower <= value <= upper):
                problem = f"is {value}, not between {lower:g} and {upper:g}"
                raise InputError("OrganSettings", name, problem, "Give a number in this range")


@dataclass(frozen=True)
class OrganSettings(SearchSettings):
    """Search settings for an organ whose marks may be few, wrong, or far from the template.

    Parameters
    ----------
    alpha, beta : float
        Weights of marks and attachments against smoothness in 1/mm^2 (Wang 2021 Eq. 5.3).
    spring : float
        Stiffness of an attached point in mN/mm.
    tangential : float
        Weight of a mark's squared error along the surface, relative to that along its normal.
    iterations : int
        Largest number of iterations at the full weight.
    enough : float
        Distance in mm of the farthest mark at which the search ends.
    progress : float
        Relative decrease of the objective below which a stage ends.
    resolution : pair of float, optional
        Least decreases in mm of the mean and the largest distance of marks in a step; a step with less of
        both ends the stage (None: no such limit).
    loose : float
        Weight in 1/mm^2 of the moves of loose ends from their first places.
    material : Material
        Material of the body.
    outliers : bool
        Whether marks much farther from the surface than the others get less weight.
    mark_error : float
        Error of a mark in mm that is usual even where other marks are more exact; the least scale by which
        marks and attachments are judged to be far beyond the others.
    covering : bool
        Whether the marks are all over the boundary, so that no part of the organ is far from all of them.
    remesh_below : float
        Smallest dihedral angle of a tet in deg below which the organ is remeshed (0: never).

    Raises
    ------
    InputError
        For a number that is out of `RANGES`.
    """

    outliers: bool = False
    mark_error: float = 0.2
    covering: bool = False
    remesh_below: float = 5.0


@dataclass(frozen=True)
class ShapeOptions(SearchSettings):
    """Search settings for a body whose shape in one pose is near a guess, over smooth strain fields.

    Parameters
    ----------
    alpha, beta : float
        Weights of marks and attachments against smoothness in 1/mm^2 (Wang 2021 Eq. 5.3).
    spring : float
        Stiffness of an attached point in mN/mm.
    tangential : float
        Weight of a mark's squared error along the surface, relative to that along its normal.
    iterations : int
        Largest number of iterations at the full weight.
    enough : float
        Distance in mm of the farthest mark at which the search ends.
    progress : float
        Relative decrease of the objective below which a stage ends.
    resolution : pair of float, optional
        Least decreases in mm of the mean and the largest distance of marks in a step; a step with less of
        both ends the stage (None: no such limit).
    loose : float
        Weight in 1/mm^2 of the moves of loose ends from their first places.
    material : Material
        Material of the body.
    fields : tuple of int
        Number of the smoothest strain fields that each stage may use.
    volume : float
        Weight of the squared logarithmic change of volume against smoothness.
    strain : float
        Weight of the squared difference from the guess's log-strains against smoothness, for a body and a
        guess that are known well.

    Raises
    ------
    InputError
        For a number that is out of `RANGES`.
    """

    alpha: float = 0.1
    beta: float = 0.1
    tangential: float = 0.05
    iterations: int = 6
    resolution: tuple[float, float] | None = None
    fields: tuple[int, ...] = (1, 12, 60)
    volume: float = 0.0
    strain: float = 0.0
