"""What is asked of a solve, and what it says it did."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, InputError


@dataclass(frozen=True)
class Options:
    """When to stop, and what to do where that fails.

    Converged: the next Newton step moves no vertex by more than `displacement_tolerance` mm, and the
    unbalanced force on every vertex is below `force_tolerance` times the forces on that vertex, as `Balance`
    measures them. Where rounding hides forces, the Newton step decides (docs/fem.md). `max_step` bounds a
    vertex's move in one iteration, in mm. `allow_partial`: hand back the best state instead of raising.
    `untangle`: try other ways where a minimum has tangles; without, the first minimum is taken as it is, as
    befits bodies that constraints tangle anyway. `barrier`: add a barrier on the volume of tets
    below a tenth of their elastic volume (`fem.elements.crushing`); a minimum with inverted tets has not
    converged.
    `coarse` (n, c) carries fields from c of the vertices to all: with it linear systems are solved by two
    levels, where a factor of all unknowns would be too large, and a step ends where the energy curves down
    (Steihaug 1983); then bound `max_step`, too.
    """

    displacement_tolerance: float = 1e-4
    force_tolerance: float = 1e-5
    max_iterations: int = 100
    max_step: float = np.inf
    allow_partial: bool = False
    untangle: bool = True
    barrier: bool = False
    coarse: sp.csr_matrix | None = None
    name: str = "equilibrium"

    def __post_init__(self) -> None:
        """Raises `InputError` for tolerances or limits out of range."""
        for name in ("displacement_tolerance", "force_tolerance", "max_step"):
            if not getattr(self, name) > 0:
                problem = f"is {getattr(self, name)}"
                raise InputError(self.name, name, problem, "Give a number above zero")
        if not self.max_iterations >= 0:
            problem = f"is {self.max_iterations}"
            raise InputError(self.name, "max_iterations", problem, "Give zero or more")


def finite(x: Array, name: str) -> Array:
    """A copy of positions (n, 3); raises `InputError` where one is not finite."""
    out = np.array(x, dtype=float)
    bad = ~np.isfinite(out).reshape(len(out), -1).all(axis=1)
    if bad.any():
        problem = f"vertex {int(np.argmax(bad))} is not finite ({int(bad.sum())} in all)"
        raise InputError(name, "x", problem, "Give a finite position for each vertex at the start")
    return out


@dataclass
class Record:
    """What a solve did.

    energies (uJ), residuals (largest vertex force, mN) and steps (largest move of a vertex, mm) have one
    entry an iteration; seconds are split by work. `projections` counts iterations whose Hessian was not
    positive definite, `escapes` stationary points left because they were no minima, `untangled` iterations
    spent on a compressible stand-in; `tangles` counts the tets that end inside out and the
    inner edges that tets do not wrap once.
    """

    converged: bool = False
    reason: str = ""
    iterations: int = 0
    factorisations: int = 0
    projections: int = 0
    escapes: int = 0
    untangled: int = 0
    tangles: int = 0
    cg_iterations: int = 0
    energies: list[float] = field(default_factory=list)
    residuals: list[float] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=lambda: {"assembly": 0.0, "linear": 0.0, "search": 0.0})

    @property
    def figures(self) -> dict[str, float]:
        """What an artifact keeps of it, by name; the residual is in mN."""
        residual = self.residuals[-1] if self.residuals else 0.0
        return {"residual": residual, "tangles": float(self.tangles)}

    def add(self, part: Record) -> None:
        """Append what a further solve did; its verdict replaces this one's."""
        for item in fields(self):
            mine, other = getattr(self, item.name), getattr(part, item.name)
            if isinstance(other, bool | str):
                setattr(self, item.name, other)
            elif item.name == "tangles":
                self.tangles = part.tangles
            elif isinstance(other, int):
                setattr(self, item.name, mine + other)
            elif isinstance(other, list):
                mine.extend(other)
            else:
                for kind, seconds in other.items():
                    mine[kind] = mine.get(kind, 0.0) + seconds


@dataclass(frozen=True)
class Equilibrium:
    """Positions x (n, 3) in mm and the record of how they were found."""

    x: Array
    record: Record
