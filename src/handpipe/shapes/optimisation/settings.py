"""Numbers that decide what a search prefers and when it ends."""

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
        Share of a mark's distance that counts along the surface.
    iterations : int
        Iterations at the full weight, at most.
    enough : float
        Distance in mm of the farthest mark at which the search ends.
    progress : float
        Relative decrease of the objective below which a stage ends.
    resolution : pair of float, optional
        Changes in mm of the mean and the largest distance that another step is worth (None: any).
    loose : float
        Weight in 1/mm^2 that keeps loose ends where they are first.
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
        """Raises `InputError` for a number outside `RANGES`."""
        for name, (lower, upper) in RANGES.items():
            value = getattr(self, name, lower)
            if not (math.isfinite(value) and lower <= value <= upper):
                problem = f"is {value}, not between {lower:g} and {upper:g}"
                raise InputError("Settings", name, problem, "Give a number in this range")


@dataclass(frozen=True)
class Settings(SearchSettings):
    """Of an organ whose marks may be few, wrong, or far from the template.

    outliers: give less weight to marks far beyond the others, beyond some times mark_error (mm) at least;
    covering: the marks are all over the boundary, and no part of the organ is far from all of them;
    remesh_below: smallest dihedral angle (deg) of a tet below which the organ is meshed anew (0: never).
    """

    outliers: bool = False
    mark_error: float = 0.2
    covering: bool = False
    remesh_below: float = 5.0


@dataclass(frozen=True)
class ShapeOptions(SearchSettings):
    """Of a body whose shape in one pose is sought near a guess, over smooth strain fields.

    fields: how many strain fields each stage may use; volume: weight of each tet's squared change of volume
    (log), strain: of its squared departure from the guess's strains, for a body and a guess that are known
    well.
    """

    alpha: float = 0.1
    beta: float = 0.1
    tangential: float = 0.05
    iterations: int = 6
    resolution: tuple[float, float] | None = None
    fields: tuple[int, ...] = (1, 12, 60)
    volume: float = 0.0
    strain: float = 0.0
