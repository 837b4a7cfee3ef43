"""Sparsity patterns, and element matrices scattered into them by index."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.patterns.assembly import Pattern
else:
    __getattr__ = face(__name__)

__all__ = ["Pattern"]
