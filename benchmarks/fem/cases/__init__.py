"""The hard cases: each a function that builds a scene and solves it with the public API of `handpipe.fem`."""

from benchmarks.fem.cases import (  # noqa: F401  (each enters its cases)
    bad_elements,
    bad_starts,
    contact,
    joint,
    plastic_strain,
    twist,
    unconstrained,
)
from benchmarks.fem.cases.outcome import CASES, Case, Outcome

__all__ = ["CASES", "Case", "Outcome"]
