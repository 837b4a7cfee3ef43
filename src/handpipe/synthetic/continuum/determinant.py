"""Derivatives of det F by F."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array

TWIST = np.zeros((3, 3, 3))  # the permutation symbol
TWIST[[0, 1, 2], [1, 2, 0], [2, 0, 1]], TWIST[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = 1.0, -1.0


def cofactors(f: Array) -> Array:
    """First derivatives (p, 3, 3) of det F, of F (p, 3, 3)."""
    return np.stack([np.cross(f[:, 1], f[:, 2]), np.cross(f[:, 2], f[:, 0]), np.cross(f[:, 0], f[:, 1])], 1)


def second_derivatives(f: Array) -> Array:
    """Second derivatives (p, 9, 9) of det F in row-major order, of F (p, 3, 3)."""
    return np.einsum("ijm,kln,pmn->pikjl", TWIST, TWIST, f).reshape(-1, 9, 9)
