"""A thin dark layer between two brighter tissues, measured below the voxel size along profiles.

A blurred thin layer looks shallower and wider than it is, and its half-intensity crossings lie too far out.
Fitting the blurred model of inner tissue, layer and outer tissue finds both faces without that bias
(Treece, Gee, Mayhew, Poole 2010, "High resolution cortical bone thickness measurement", Sec. 2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from handpipe.core import Array

WINDOW = 2.5  # deviations of the blur beyond a face that the fit looks at
SIGNIFICANT = 0.25  # least rise to the outer tissue, of the inner tissue's contrast with the layer
MISFIT = 1.5  # deviations of noise that a good fit leaves
AT_END = 0.98  # of the reach: a face there was not found
SURE = 0.2  # mm, deviation of a face at which confidence is half
NEGLIGIBLE = 1e-3  # weight of a sample beyond the window
DAMPING = 1e-2  # first, of the diagonal
LESS, LEAST, MORE, MOST = 0.2, 1e-6, 6.0, 1e4  # factors on damping and its bounds
ITERATIONS = 20  # at most
THINNEST = 0.05  # mm
STILL = 1e-3  # mm that both faces move in the last iteration


class DarkLayers(NamedTuple):
    """Dark layers fitted to profiles.

    Parameters
    ----------
    inner : array (n,)
        Offset of the inner face in mm.
    thickness : array (n,)
        Thickness in mm.
    inner_confidence, thickness_confidence : array (n,)
        Confidence in the inner face and in the thickness, in [0, 1].
    misfit : array (n,)
        Mean squared residual in variances of the noise.
    """

    inner: Array
    thickness: Array
    inner_confidence: Array
    thickness_confidence: Array
    misfit: Array


class _Look(NamedTuple):
    """How a layer looks: its level, the deviation of the blur in mm, and that of the noise."""

    dark: float
    blur: float
    noise: float


def fit_dark_layers(
    profiles: Array,
    offsets: Array,
    dark: float,
    blur: float | Array,
    noise: float,
    reach: float | Array,
    thickness: float,
) -> DarkLayers:
    """Inner face and thickness of the dark layer in each profile.

    Parameters
    ----------
    profiles : array (n, m)
        Intensities, the inner tissue first.
    offsets : array (m,)
        Offsets of the samples in mm, ascending.
    dark : float
        Intensity of the layer.
    blur : float or array (n,)
        Standard deviation of the image's point spread in mm, of all profiles or of each, where the image is
        coarser in some directions.
    noise : float
        Standard deviation of the intensities.
    reach : float or array (n,)
        Largest distance of the inner face from offset 0 in mm, of all profiles or of each. The outer face
        lies before the last offset.
    thickness : float
        Usual thickness in mm, where a fit starts.

    Returns
    -------
    DarkLayers
        Faces, confidences and misfits by profile.
    """
    blurs, reaches = (np.broadcast_to(np.asarray(v, float), len(profiles)).copy() for v in (blur, reach))
    fits = _fit(np.ascontiguousarray(profiles), offsets, dark, blurs, noise, reaches, thickness)
    inner, thick, low, high, misfit, deviation_inner, deviation_thick = fits.T
    good = np.exp(-0.5 * np.maximum(misfit - MISFIT, 0.0))
    inside = (np.abs(inner) < AT_END * reach) & (low - dark > 3 * noise)
    found = (high - dark > np.maximum(SIGNIFICANT * (low - dark), 3 * noise)) & (
        inner + thick < offsets[-1] - blur
    )
    inner_confidence = inside * good / (1 + (deviation_inner / SURE) ** 2)
    thick_confidence = inside * found * good / (1 + (deviation_thick / SURE) ** 2)
    return DarkLayers(inner, thick, inner_confidence, thick_confidence, misfit)


def fit_dark_level(
    profiles: Array,
    offsets: Array,
    candidates: Array,
    blur: float | Array,
    noise: float,
    reach: float | Array,
    thickness: float,
) -> float:
    """The layer's intensity for which the model explains the profiles best.

    Parameters
    ----------
    profiles, offsets
        As for `fit_dark_layers`.
    candidates : array (c,)
        Intensities to choose from.
    blur, noise, reach, thickness
        As for `fit_dark_layers`.

    Returns
    -------
    float
        The candidate with the least median misfit.
    """
    arguments = (blur, noise, reach, thickness)
    misfits = [np.median(fit_dark_layers(profiles, offsets, c, *arguments).misfit) for c in candidates]
    return float(candidates[int(np.argmin(misfits))])


@njit(cache=True)
def _model(s, p, dark, blur):  # type: ignore[no-untyped-def]
    """Value and derivatives by (inner face, thickness, inner level, outer level) at offset s."""
    a, b = (s - p[0]) / blur, (s - p[0] - p[1]) / blur
    fa, fb = 0.5 * (1 + math.erf(a / math.sqrt(2))), 0.5 * (1 + math.erf(b / math.sqrt(2)))
    norm = 1 / (blur * math.sqrt(2 * math.pi))
    ga, gb = norm * math.exp(-0.5 * a * a), norm * math.exp(-0.5 * b * b)
    value = p[2] * (1 - fa) + dark * (fa - fb) + p[3] * fb
    d_thickness = (dark - p[3]) * gb
    return value, (p[2] - dark) * ga + d_thickness, d_thickness, 1 - fa, fb


@njit(cache=True)
def _start(profile, offsets, dark, reach, thickness, p):  # type: ignore[no-untyped-def]
    """First guess from the levels on either side and the crossings half-way from them to the layer."""
    m = len(offsets)
    p[2] = dark
    for q in range(m):
        if offsets[q] <= 0:
            p[2] = max(p[2], profile[q])
    half = 0.5 * (p[2] + dark)
    p[0] = 0.0
    best = reach
    for q in range(1, m):
        if profile[q - 1] >= half > profile[q]:
            s = offsets[q - 1] + (offsets[q] - offsets[q - 1]) * (profile[q - 1] - half) / (
                profile[q - 1] - profile[q]
            )
            if abs(s) < best:
                best, p[0] = abs(s), s
    p[1], p[3] = thickness, profile[m - 1]
    rising = False
    for q in range(m):
        if (
            offsets[q] > p[0]
            and not rising
            and profile[q] > 0.5 * (p[3] + dark)
            and profile[q] > profile[q - 1]
        ):
            p[1] = max(offsets[q] - p[0], 0.5 * thickness)
            rising = True


@njit(cache=True)
def _prior(p, start, precision, h, g):  # type: ignore[no-untyped-def]
    """Add a Gaussian prior about the start to the normal equations; return its energy."""
    energy = 0.0
    for c in range(4):
        d = p[c] - start[c]
        energy += precision[c] * d * d
        h[c, c] += precision[c]
        g[c] += precision[c] * d
    return energy


@njit(cache=True)
def _normal_equations(profile, offsets, look, p, h, g):  # type: ignore[no-untyped-def]
    """Gauss-Newton matrix h and gradient g of the misfit up to one window beyond either face; its mean."""
    dark, blur, noise = look
    window = WINDOW * blur
    h[:] = 0.0
    g[:] = 0.0
    energy = 0.0
    weight_sum = 0.0
    j = np.empty(4)
    for q in range(len(offsets)):
        beyond = max(offsets[q] - p[0] - p[1] - window, p[0] - window - offsets[q])
        weight = 1.0 if beyond < 0 else math.exp(-0.5 * (beyond / blur) ** 2)
        if weight < NEGLIGIBLE:
            continue
        value, j[0], j[1], j[2], j[3] = _model(offsets[q], p, dark, blur)
        r = (value - profile[q]) / noise
        energy += weight * r * r
        weight_sum += weight
        for a in range(4):
            g[a] += weight * r * j[a] / noise
            for b in range(4):
                h[a, b] += weight * j[a] * j[b] / noise**2
    return energy, energy / weight_sum if weight_sum > 0 else np.inf  # no sample near the faces


@njit(cache=True)
def _factorise(h, damping, lower):  # type: ignore[no-untyped-def]
    """Cholesky factor (4, 4) of a positive matrix with its diagonal enlarged by a share."""
    for i in range(4):
        for j in range(i + 1):
            total = h[i, j] * (1 + damping) if i == j else h[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(max(total, 1e-300)) if i == j else total / lower[j, j]


@njit(cache=True)
def _substitute(lower, b, x):  # type: ignore[no-untyped-def]
    """Solve L L^T x = b."""
    for i in range(4):
        x[i] = b[i]
        for k in range(i):
            x[i] -= lower[i, k] * x[k]
        x[i] /= lower[i, i]
    for i in range(3, -1, -1):
        for k in range(i + 1, 4):
            x[i] -= lower[k, i] * x[k]
        x[i] /= lower[i, i]


@njit(cache=True)
def _fit(profiles, offsets, dark, blurs, noise, reaches, thickness):  # type: ignore[no-untyped-def]
    """Levenberg-Marquardt for every profile: rows of parameters, misfit and deviations of the faces."""
    n = len(profiles)
    out = np.zeros((n, 7))
    h, g, start, trial = np.zeros((4, 4)), np.zeros(4), np.zeros(4), np.zeros(4)
    h2, g2, p = np.zeros((4, 4)), np.zeros(4), np.zeros(4)
    lower, step, unit, precision = np.zeros((4, 4)), np.zeros(4), np.zeros(4), np.zeros(4)
    longest = offsets[-1]
    for i in range(n):
        profile, blur, reach = profiles[i], blurs[i], reaches[i]
        look = _Look(dark, blur, noise)
        _start(profile, offsets, dark, reach, thickness, start)
        precision[0], precision[1] = 1 / reach**2, 1 / (4 * thickness) ** 2
        precision[2], precision[3] = 1 / (5 * noise) ** 2, 1 / max(start[2] - dark, noise) ** 2
        p[:] = start
        energy, misfit = _normal_equations(profile, offsets, look, p, h, g)
        energy += _prior(p, start, precision, h, g)
        damping = DAMPING
        for _ in range(ITERATIONS):
            _factorise(h, damping, lower)
            _substitute(lower, g, step)
            trial[:] = p - step
            trial[0] = min(max(trial[0], -reach), reach)
            trial[1] = min(max(trial[1], THINNEST), longest - trial[0])
            trial[2] = max(trial[2], dark)
            trial[3] = max(trial[3], dark)
            energy2, misfit2 = _normal_equations(profile, offsets, look, trial, h2, g2)
            energy2 += _prior(trial, start, precision, h2, g2)
            if energy2 < energy:
                small = abs(trial[0] - p[0]) + abs(trial[1] - p[1]) < STILL
                p[:], energy, misfit = trial, energy2, misfit2
                h[:], g[:] = h2, g2
                damping = max(damping * LESS, LEAST)
                if small:
                    break
            else:
                damping *= MORE
                if damping > MOST:
                    break
        out[i, :4] = p
        out[i, 4] = misfit
        _factorise(h, 0.0, lower)
        for c in range(2):
            unit[:] = 0.0
            unit[c] = 1.0
            _substitute(lower, unit, step)
            out[i, 5 + c] = math.sqrt(max(step[c], 0.0))
    return out
