"""Types of arrays, their dtype and not their shape, which docstrings tell; unit vectors; equal steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
BoolArray = NDArray[np.bool_]


def unit_vectors(vectors: Array) -> Array:
    """Vectors scaled to length 1.

    Parameters
    ----------
    vectors : array (..., 3)
        Vectors in any unit.

    Returns
    -------
    array (..., 3)
        Unit vectors; zero where the vector is zero.
    """
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))


def evenly(count: int, most: int) -> IntArray:
    """Numbers from 0 to count - 1: all, or as many in equal steps, the first and the last among them.

    Parameters
    ----------
    count : int
        How many there are.
    most : int
        How many are taken at most.

    Returns
    -------
    array (min(count, most),) of int
        The numbers, in order.
    """
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.int64)
