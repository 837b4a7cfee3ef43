"""Equilibria of sums of potentials: one, along a load, or with contact planes updated."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.solver import equilibrium
    from handpipe.fem.solver.equilibrium import Equilibrium, Options, Steps, continuation, solve
    from handpipe.fem.solver.prescribed_motion import approach
    from handpipe.fem.solver.settling import Limits, NearEnough, Settled, largest, root_mean_square, settle
else:
    __getattr__ = face(__name__)

__all__ = [
    "Equilibrium",
    "Limits",
    "NearEnough",
    "Options",
    "Settled",
    "Steps",
    "approach",
    "continuation",
    "equilibrium",
    "largest",
    "root_mean_square",
    "settle",
    "solve",
]
