"""Large arrays that are reused once nobody else references them."""

from __future__ import annotations

import sys

import numpy as np

from handpipe.core import Array

KEPT = 3  # arrays: two matrices that a solver compares, and the next one
OWN_REFERENCES = 3  # the list, the loop variable and the argument of getrefcount


class Buffers:
    """Arrays handed out and, when every matrix and view made of them is gone, handed out again."""

    def __init__(self) -> None:
        self._arrays: list[Array] = []

    def take(self, size: int) -> Array:
        """An array (size,) of any values that nobody else references."""
        for array in self._arrays:
            if len(array) == size and sys.getrefcount(array) == OWN_REFERENCES:
                return array
        fresh = np.empty(size)
        self._arrays = [*self._arrays[-(KEPT - 1) :], fresh]
        return fresh

    def __deepcopy__(self, memo: dict) -> Buffers:  # type: ignore[type-arg]
        """A set of buffers without arrays: copies of a potential share none."""
        return Buffers()

    def __reduce__(self) -> tuple:  # type: ignore[type-arg]
        """Pickled without arrays: a set of buffers is empty when unpickled."""
        return Buffers, ()
