"""Compiled loops over vertices: correctives and skinning in one pass, in single precision."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from handpipe.core import Array, Int32Array, IntArray

SMALL = 1e-12  # below which a squared length is zero


class Drivers(NamedTuple):
    """What drives the shapes of each part p.

    of_part[at[p]:at[p + 1]]: its angles; from known_at[p] on `known` has its learned poses, row by row, and
    from gains_at[p] on `gains` their gains (poses, shapes); ends[p]:ends[p + 1]: its shapes among all; kinds
    (p, 2): degree of a polynomial, or zero and the width of a Gaussian.
    """

    of_part: IntArray
    at: IntArray
    kinds: Array
    known: Array
    known_at: IntArray
    gains: Array
    gains_at: IntArray
    ends: IntArray


class VertexShapes(NamedTuple):
    """What the parts add to each vertex.

    Rows rows[v]:rows[v + 1] are the parts of vertex v; from starts[r] on, `basis` has x of each shape of the
    part parts[r], then y, then z.
    """

    rows: Int32Array
    parts: Int32Array
    starts: IntArray
    basis: Array


@njit(cache=True)
def radial(squared: float, width: float) -> float:
    """A Gaussian of the distance."""
    return float(np.exp(-squared / (2 * width * width)))


@njit(cache=True)
def coefficients(places: Any, drivers: Drivers, out: Any) -> None:
    """Coefficients of every part's shapes at scaled angles (a,), into out (K,)."""
    of_part, at, kinds, known, known_at, gains, gains_at, ends = drivers
    for p in range(len(kinds)):
        first, dof = at[p], at[p + 1] - at[p]
        shapes = ends[p + 1] - ends[p]
        out[ends[p] : ends[p + 1]] = 0.0
        count = (gains_at[p + 1] - gains_at[p]) // max(shapes, 1)
        for f in range(count):
            dot, squared = 0.0, 0.0
            row = known_at[p] + f * dof
            for i in range(dof):
                a, b = places[of_part[first + i]], known[row + i]
                dot += a * b
                squared += (a - b) * (a - b)
            value = 1.0 + dot / max(dof, 1)
            if kinds[p, 0] > 0:
                value = value ** kinds[p, 0]
            else:
                value += radial(squared, kinds[p, 1])
            gain = gains_at[p] + f * shapes
            for k in range(shapes):
                out[ends[p] + k] += value * gains[gain + k]


@njit(cache=True, fastmath=True)
def correct(rest: Any, shapes: VertexShapes, ends: Any, amounts: Any, out: Any) -> None:
    """Neutral points (n, 3) with the parts' shapes added by their amounts (K,), into out (n, 3)."""
    rows, parts, starts, basis = shapes
    for v in range(len(rest)):
        x, y, z = rest[v, 0], rest[v, 1], rest[v, 2]
        for r in range(rows[v], rows[v + 1]):
            first = ends[parts[r]]
            count = ends[parts[r] + 1] - first
            here, own = basis[starts[r] : starts[r] + 3 * count], amounts[first : first + count]
            for k in range(count):
                x += own[k] * here[k]
            for k in range(count):
                y += own[k] * here[count + k]
            for k in range(count):
                z += own[k] * here[2 * count + k]
        out[v, 0], out[v, 1], out[v, 2] = x, y, z


@njit(cache=True, fastmath=True)
def skin(points: Any, joints: Any, weights: Any, motions: Any, out: Any) -> None:
    """Points (n, 3) moved by weighted means of four bones' motions (b, 3, 4), into out (n, 3)."""
    for v in range(len(points)):
        x, y, z = points[v, 0], points[v, 1], points[v, 2]
        a = b = c = np.float32(0.0)
        for k in range(4):
            w = weights[v, k]
            if w > 0:
                m = motions[joints[v, k]]
                a += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
                b += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
                c += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
        out[v, 0], out[v, 1], out[v, 2] = a, b, c


@njit(cache=True)
def dual_quaternions(motions: Any, out: Any) -> None:
    """Real and dual parts (b, 8), each as w, x, y, z, of motions (b, 3, 4)."""
    for i in range(len(motions)):
        m, q = motions[i], out[i]
        trace = m[0, 0] + m[1, 1] + m[2, 2]
        largest = 0
        for k in range(1, 3):
            if m[k, k] > m[largest, largest]:
                largest = k
        if trace > m[largest, largest]:
            q[0] = 1 + trace
            q[1], q[2], q[3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
        else:
            j, k = (largest + 1) % 3, (largest + 2) % 3
            q[0] = m[k, j] - m[j, k]
            q[1 + largest] = 1 + m[largest, largest] - m[j, j] - m[k, k]
            q[1 + j], q[1 + k] = m[j, largest] + m[largest, j], m[k, largest] + m[largest, k]
        norm = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        for k in range(4):
            q[k] /= norm
        w, x, y, z = q[0], q[1], q[2], q[3]
        a, b, c = m[0, 3], m[1, 3], m[2, 3]
        q[4] = -(a * x + b * y + c * z) / 2
        q[5] = (a * w + b * z - c * y) / 2
        q[6] = (b * w + c * x - a * z) / 2
        q[7] = (c * w + a * y - b * x) / 2


@njit(cache=True, fastmath=True)
def skin_dual(points: Any, joints: Any, weights: Any, duals: Any, which: Any, out: Any) -> None:
    """As `skin` for vertices `which` (k,), by blends of dual quaternions (b, 8) (Kavan 2008).

    They are taken on the side of the first bone's.
    """
    q = np.zeros(8, np.float32)
    for v in which:
        first = duals[joints[v, 0]]
        q[:] = 0.0
        for k in range(4):
            w = weights[v, k]
            if w > 0:
                d = duals[joints[v, k]]
                side = first[0] * d[0] + first[1] * d[1] + first[2] * d[2] + first[3] * d[3]
                w = -w if side < 0 else w
                for i in range(8):
                    q[i] += w * d[i]
        norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
        w, x, y, z = q[0], q[1], q[2], q[3]
        e, f, g, h = q[4], q[5], q[6], q[7]
        a, b, c = points[v, 0], points[v, 1], points[v, 2]
        i = w * a + y * c - z * b
        j = w * b + z * a - x * c
        k = w * c + x * b - y * a
        out[v, 0] = a + 2 * (y * k - z * j + w * f - e * x + y * h - z * g) / norm
        out[v, 1] = b + 2 * (z * i - x * k + w * g - e * y + z * f - x * h) / norm
        out[v, 2] = c + 2 * (x * j - y * i + w * h - e * z + x * g - y * f) / norm


@njit(cache=True)
def nearest(places: Any, drivers: Drivers, out: Any) -> None:
    """Root mean square distance of scaled angles (a,) to the nearest learned pose, into out (parts,)."""
    of_part, at, known, known_at = drivers.of_part, drivers.at, drivers.known, drivers.known_at
    for p in range(len(at) - 1):
        first, dof = at[p], at[p + 1] - at[p]
        least = np.inf if dof else 0.0
        for row in range(known_at[p], known_at[p + 1], max(dof, 1)):
            squared = 0.0
            for i in range(dof):
                step = places[of_part[first + i]] - known[row + i]
                squared += step * step
            least = min(least, squared)
        out[p] = np.sqrt(least / max(dof, 1))
