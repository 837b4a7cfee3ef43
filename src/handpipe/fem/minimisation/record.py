"""Options of a solve, and the record of what it did."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, InputError


@dataclass(frozen=True)
class Options:
    """When a solve stops, and what it does where that fails.

    A solve has converged if the next Newton step and the unbalanced forces are below their tolerances. Where
    rounding hides forces, the Newton step alone decides (docs/fem.md).

    Parameters
    ----------
    displacement_tolerance : float
        Largest move of a vertex in mm in the next Newton step.
    force_tolerance : float
        Largest unbalanced force on a vertex relative to the forces on that vertex, which `Balance` measures.
    max_iterations : int
        Newton iterations of one minimisation, zero or more.
    max_step : float
        Largest move of a vertex in mm in one iteration.
    allow_partial : bool
        Return the best state where a solve does not converge, instead of raising an error.
    untangle : bool
        Try other solution methods where a minimum has tangles. Without, the first minimum is returned, which
        suits bodies that constraints tangle anyway.
    barrier : bool
        Add a barrier on the volume of tets below a tenth of their elastic volume (`fem.elements.crushing`);
        a minimum with inverted tets has not converged.
    saddles : bool
        Accept a stationary point that is no minimum, as suits the way to another load.
    coarse : sparse matrix (n, c), optional
        Carries fields from c of the vertices to all n. With it linear systems are solved by two levels, where
        a factor of all unknowns would be too large, and a step ends at negative curvature (Steihaug 1983);
        then bound `max_step`, too.
    single : bool
        Factorise in single precision, and refine solutions by conjugate gradients to the same tolerance. For
        systems of 100,000 unknowns and more, whose factors take most of the time and memory.
    enough : callable, optional
        From positions (n, 3) and the step (n, 3) that led to them, both in mm, to whether the solve may end
        there although it has not converged.
    name : str
        Name of the solve in log lines and errors.

    Raises
    ------
    InputError
        If a tolerance or a limit is out of range.

    References
    ----------
    Steihaug 1983.
    """

    displacement_tolerance: float = 1e-4
    force_tolerance: float = 1e-5
    max_iterations: int = 100
    max_step: float = np.inf
    allow_partial: bool = False
    untangle: bool = True
    barrier: bool = False
    saddles: bool = False
    coarse: sp.csr_matrix | None = None
    single: bool = False
    enough: Callable[[Array, Array], bool] | None = None
    name: str = "equilibrium"

    def __post_init__(self) -> None:
        """Check tolerances and limits."""
        for name in ("displacement_tolerance", "force_tolerance", "max_step"):
            if not getattr(self, name) > 0:
                problem = f"is {getattr(self, name)}"
                raise InputError(self.name, name, problem, "Give a number above zero")
        if not self.max_iterations >= 0:
            problem = f"is {self.max_iterations}"
            raise InputError(self.name, "max_iterations", problem, "Give zero or more")


def finite(x: Array, name: str) -> Array:
    """A copy of positions (n, 3).

    Raises
    ------
    InputError
        If a position is not finite.
    """
    out = np.array(x, dtype=float)
    bad = ~np.isfinite(out).reshape(len(out), -1).all(axis=1)
    if bad.any():
        problem = f"vertex {int(np.argmax(bad))} is not finite ({int(bad.sum())} in all)"
        raise InputError(name, "x", problem, "Give a finite position for each vertex at the start")
    return out


@dataclass
class Record:
    """What a solve did.

    Parameters
    ----------
    converged : bool
        Whether the solve has converged.
    reason : str
        Why the solve ended.
    iterations : int
        Newton iterations.
    factorisations : int
        Factorisations of linear systems.
    projections : int
        Iterations whose Hessian was not positive definite.
    escapes : int
        Stationary points that the solve left because they were no minima.
    untangled : int
        Iterations spent on a compressible substitute of the bodies.
    tangles : int
        Inverted tets at the end, and inner edges that their tets do not surround exactly once.
    cg_iterations : int
        Iterations of conjugate gradients.
    relaxed : int
        Times that the energy was minimised over a few vertices before a step of all.
    energies : list of float
        Energy in µJ of each iteration.
    residuals : list of float
        Largest unbalanced force on a vertex in mN of each iteration.
    steps : list of float
        Largest move of a vertex in mm of each iteration.
    seconds : dict of str to float
        Seconds of assembly, linear solves and line search.
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
    relaxed: int = 0
    energies: list[float] = field(default_factory=list)
    residuals: list[float] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=lambda: {"assembly": 0.0, "linear": 0.0, "search": 0.0})

    @property
    def figures(self) -> dict[str, float]:
        """Figures for an artifact, by name; the residual is in mN."""
        residual = self.residuals[-1] if self.residuals else 0.0
        return {"residual": residual, "tangles": float(self.tangles)}

    def add(self, part: Record) -> None:
        """Append the record of a further solve; its outcome replaces this one's."""
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
    """Positions at the end of a solve and its record.

    Parameters
    ----------
    x : array (n, 3)
        Positions in mm.
    record : Record
        What the solve did.
    """

    x: Array
    record: Record
