"""A discrete rod: a polyline of segments of one length, with frames that do not twist.

Positions x (Q+1, 3) carry the shape. Orientation is one twist angle a segment against the Bishop (parallel
transported) frame of the curve: a unit normal perpendicular to its segment is then kept by construction,
which replaces the normals n and the constraints of Eq. 6-7 of Zheng et al. 2022.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.optimize import brentq

from handpipe.core import Array, IntArray


@njit(cache=True)
def _march(curve: Array, length: float, count: int, end: Array) -> tuple[Array, float]:
    """Walk along a polyline by chords of one length; past its end go straight along `end`.

    The second result is the part of the last chord that lies beyond the curve's end (0 where it ends inside).
    """
    x = np.empty((count + 1, 3))
    x[0] = curve[0]
    segment, last, beyond = 0, len(curve) - 1, 0.0
    for i in range(count):
        while segment < last and np.sum((curve[segment + 1] - x[i]) ** 2) < length**2:
            segment += 1
        if segment == last:
            beyond = length - np.sqrt(np.sum((curve[last] - x[i]) ** 2)) if beyond == 0.0 else length
            origin, direction = curve[last], end
        else:
            origin = curve[segment]
            direction = curve[segment + 1] - curve[segment]
        # |origin + a direction - x_i| = length, the larger root
        offset = origin - x[i]
        a = np.sum(direction * direction)
        b = np.sum(direction * offset)
        c = np.sum(offset * offset) - length**2
        x[i + 1] = origin + (-b + np.sqrt(max(b * b - a * c, 0.0))) / a * direction
    return x, beyond


def arc_length(x: Array) -> Array:
    """Length (n,) from the first point to each point of a polyline (n, 3), in mm."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))])


def unit(v: Array) -> Array:
    """Vectors (..., 3) divided by their length."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def directions(x: Array) -> Array:
    """Unit tangent (Q, 3) of each segment."""
    return unit(np.diff(x, axis=0))


def tangents(x: Array) -> Array:
    """Unit tangent (Q+1, 3) at each vertex, the mean of its segments'."""
    d = directions(x)
    return unit(np.vstack([d[:1], d[:-1] + d[1:], d[-1:]]))


def resample(curve: Array, spacing: float) -> Array:
    """A rod along a curve (n, 3): equal segments of about `spacing` mm, ending on the curve's end.

    Returns x (Q+1, 3); all segments have the same length to rounding.
    """
    total = arc_length(curve)[-1]
    count = max(int(round(total / spacing)), 2)
    end = unit(curve[-1] - curve[-2])

    def miss(length: float) -> float:
        x, beyond = _march(curve, length, count, end)
        return beyond if beyond > 0 else -float(np.linalg.norm(curve[-1] - x[-1]))

    longest = total / count
    shortest = 0.5 * longest
    length = longest if miss(longest) <= 0 else brentq(miss, shortest, longest, xtol=1e-12)
    return _march(curve, length, count, end)[0]


def lay(curve: Array, segment_length: float, count: int, end: Array) -> Array:
    """Lay a rod of `count` segments along a curve (n, 3) from its start; past its end along `end` (3,)."""
    return _march(np.ascontiguousarray(curve, float), segment_length, count, unit(np.asarray(end, float)))[0]


def segment_length(x: Array) -> float:
    """Length of one segment in mm (the mean, where they differ by rounding)."""
    return float(np.linalg.norm(np.diff(x, axis=0), axis=1).mean())


def length_change(x: Array, length: float) -> float:
    """Largest relative change of a segment's length (Eq. 5): max |‖x_i+1 - x_i‖ / length - 1|.

    Parameters
    ----------
    x : array (Q+1, 3)
        Rod in mm.
    length : float
        Rest length of a segment in mm.

    Returns
    -------
    float
        Relative change, never negative.
    """
    return float(np.abs(np.linalg.norm(np.diff(x, axis=0), axis=1) / length - 1.0).max())


@njit(cache=True)
def _transport(d: Array, first: Array) -> Array:
    normals = np.empty_like(d)
    n = first - np.sum(first * d[0]) * d[0]
    normals[0] = n / np.sqrt(np.sum(n * n))
    for i in range(1, len(d)):
        # two reflections (double reflection method): d[i-1] onto d[i] by the smallest rotation
        s = d[i - 1] + d[i]
        n = normals[i - 1] - 2.0 * np.sum(normals[i - 1] * s) / max(np.sum(s * s), 1e-12) * s
        n = n - np.sum(n * d[i]) * d[i]
        normals[i] = n / np.sqrt(np.sum(n * n))
    return normals


def bishop_normals(x: Array, first: Array) -> Array:
    """Unit normal (Q, 3) of each segment, `first` (3,) carried along the rod without twist."""
    return _transport(directions(x), np.asarray(first, float))


def perpendicular(direction: Array) -> Array:
    """Some unit vector perpendicular to a direction (3,): the start of a rest rod's frames."""
    axis = np.eye(3)[np.argmin(np.abs(direction))]
    return unit(np.cross(direction, axis))


def frames(x: Array, first: Array, twist: Array | None = None) -> Array:
    """Rotation (Q, 3, 3) of each segment, columns tangent, normal, binormal.

    `first` (3,) is the normal of the first segment (made perpendicular to it), `twist` (Q,) the angles in rad
    of the segments' normals about their tangents against the Bishop frame, by default none.
    """
    d, n = directions(x), bishop_normals(x, first)
    b = np.cross(d, n)
    if twist is not None:
        c, s = np.cos(twist)[:, None], np.sin(twist)[:, None]
        n, b = c * n + s * b, c * b - s * n
    return np.stack([d, n, b], axis=2)


@njit(cache=True)
def _closest(points: Array, x: Array) -> tuple[IntArray, Array, Array]:
    segment = np.empty(len(points), np.int64)
    parameter = np.empty(len(points))
    distance = np.empty(len(points))
    for k in range(len(points)):
        best = np.inf
        for i in range(len(x) - 1):
            e = x[i + 1] - x[i]
            t = min(max(np.sum((points[k] - x[i]) * e) / np.sum(e * e), 0.0), 1.0)
            squared = np.sum((x[i] + t * e - points[k]) ** 2)
            if squared < best:
                best, segment[k], parameter[k] = squared, i, t
        distance[k] = np.sqrt(best)
    return segment, parameter, distance


def closest_on_rod(points: Array, x: Array) -> tuple[IntArray, Array, Array]:
    """Segment (k,), barycentric coordinate t in [0, 1] (k,) and distance (k,) of the closest point of a rod.

    A segment's point is (1 - t) x_i + t x_i+1 (Eq. 8 and 10).
    """
    return _closest(np.ascontiguousarray(points, float), np.ascontiguousarray(x, float))


def point_at(x: Array, segment: IntArray, t: Array) -> Array:
    """Points (k, 3) of a rod at segments (k,) and barycentric coordinates (k,)."""
    return (1.0 - t)[:, None] * x[segment] + t[:, None] * x[segment + 1]
