"""Sparse symmetric linear systems: factorisations, null spaces, iterative solvers."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.linear.factorisation import Factor, NotPositiveDefinite, SingularMatrix, factorise
    from handpipe.fem.linear.nullspace import DeflatedFactor, unit_twists
    from handpipe.fem.linear.two_level import with_nodes
else:
    __getattr__ = face(__name__)

__all__ = [
    "DeflatedFactor",
    "Factor",
    "NotPositiveDefinite",
    "SingularMatrix",
    "factorise",
    "unit_twists",
    "with_nodes",
]
