"""Types of arrays: their dtype, not their shape, which docstrings tell; and vectors of unit length."""

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
