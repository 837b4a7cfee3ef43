"""Twist of a rod: one angle a segment against the Bishop frame (the twist part of Eq. 12, Zheng et al. 2022).

With the bending left to the positions, Eq. 12 is -sum cos(a_i+1 - a_i) - c3 cos(a_1): without other loads
every angle is zero. A tube whose section is not round is turned by its target surface as well.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from handpipe.core import Array
from handpipe.tissues.tendons.fitting.surface_fit import SurfaceFit
from handpipe.tissues.tendons.rods.rod import frames
from handpipe.tissues.tendons.rods.tube import SEGMENTS

CONVEX = 0.1  # least cosine of a twist in the Hessian, which keeps it positive


def twist_energy(angles: Array, anchor: float = 1.0) -> float:
    """-sum cos(a_i+1 - a_i) - anchor cos(a_1) of angles (Q,) in rad, `anchor` the paper's c3."""
    return float(-np.cos(np.diff(angles)).sum() - anchor * np.cos(angles[0]))


def twist_gradient(angles: Array, anchor: float = 1.0) -> Array:
    """Gradient (Q,) of `twist_energy`."""
    s = np.sin(np.diff(angles))
    g = np.zeros_like(angles)
    g[1:] += s
    g[:-1] -= s
    g[0] += anchor * np.sin(angles[0])
    return g


def _twist_bands(angles: Array, anchor: float) -> Array:
    """Upper bands (SEGMENTS, Q) of the Hessian of `twist_energy`, kept positive."""
    c = np.maximum(np.cos(np.diff(angles)), CONVEX)
    bands = np.zeros((SEGMENTS, len(angles)))
    bands[-1, 1:] += c
    bands[-1, :-1] += c
    bands[-1, 0] += anchor * max(np.cos(angles[0]), CONVEX)
    bands[-2, 1:] -= c
    return bands


def untwisted(
    angles: Array, stiffness: float, fit: SurfaceFit | None, x: Array, anchor: float = 1.0
) -> Array:
    """One Gauss-Newton step of the angles (Q,) in stiffness * `twist_energy` plus a surface fit."""
    bands = stiffness * _twist_bands(angles, anchor)
    gradient = stiffness * twist_gradient(angles, anchor)
    if fit is not None:
        fit.twist = angles
        fit.refresh(x)
        turned = frames(x, fit.first_normal, angles)
        v, tube = fit.tube.skin(x, turned), fit.tube
        residual = np.sum(fit.normals * (v - fit.closest), axis=1)
        carried = turned[tube.carriers]
        r = np.einsum("nsij,nsj->nsi", carried, tube.local)
        rows = tube.weights * np.sum(fit.normals[:, None] * np.cross(carried[..., 0], r), axis=2)
        for a in range(SEGMENTS):
            np.add.at(gradient, tube.first + a, 2.0 * fit.weights * residual * rows[:, a])
            for b in range(a, SEGMENTS):
                band = bands[SEGMENTS - 1 - (b - a)]
                np.add.at(band, tube.first + b, 2.0 * fit.weights * rows[:, a] * rows[:, b])
    return angles - solveh_banded(bands, gradient)
