"""Closed tubes: rings of points along a line, joined and closed by a pole at each end."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, IntArray


def superellipse(count: int, exponent: float, phase: float = 0.0) -> Array:
    """Points (count, 2) of |a|^p + |b|^p = 1, counter-clockwise, evenly spaced in angle."""
    angle = 2.0 * np.pi * (np.arange(count) + phase) / count
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    return direction / (np.abs(direction) ** exponent).sum(axis=1, keepdims=True) ** (1.0 / exponent)


def close_rings(rings: Array, start: Array, end: Array) -> tuple[Array, IntArray]:
    """Closed surface of rings (k, m, 3) with poles `start` and `end` (3,).

    Rings turn counter-clockwise as seen from `end`; then triangles point outwards.
    Vertices are the start pole, the rings in order, the end pole.
    """
    k, m, _ = rings.shape
    i, j = np.meshgrid(np.arange(k - 1), np.arange(m), indexing="ij")
    a, b = 1 + i * m + j, 1 + i * m + (j + 1) % m
    c, d = a + m, b + m
    sides = np.stack([np.stack([a, b, d], -1), np.stack([a, d, c], -1)], 2).reshape(-1, 3)
    around, pole = np.arange(m), 1 + k * m
    following = (around + 1) % m
    first = np.column_stack([np.zeros(m, int), 1 + following, 1 + around])
    last = np.column_stack([np.full(m, pole), pole - m + around, pole - m + following])
    vertices = np.concatenate([start[None], rings.reshape(-1, 3), end[None]])
    return np.ascontiguousarray(vertices), np.concatenate([sides, first, last]).astype(np.int64)


def sweep(centreline: Array, radius: float, sides: int = 16) -> tuple[Array, IntArray]:
    """Closed round tube of a radius about a polyline (n, 3), with parallel-transported rings."""
    tangent = np.gradient(centreline, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.empty_like(tangent)
    normal[0] = np.cross(tangent[0], np.eye(3)[np.argmin(np.abs(tangent[0]))])
    for n in range(1, len(tangent)):
        normal[n] = normal[n - 1]
        normal[n] -= (normal[n] @ tangent[n]) * tangent[n]
        normal[n] /= np.linalg.norm(normal[n])
    normal[0] /= np.linalg.norm(normal[0])
    binormal = np.cross(tangent, normal)
    circle = radius * superellipse(sides, 2.0)
    rings = (
        centreline[:, None] + circle[None, :, :1] * normal[:, None] + circle[None, :, 1:] * binormal[:, None]
    )
    return close_rings(rings, centreline[0], centreline[-1])


def volume(vertices: Array, triangles: IntArray) -> float:
    """Volume in mm^3 of a closed surface, by the divergence theorem."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
