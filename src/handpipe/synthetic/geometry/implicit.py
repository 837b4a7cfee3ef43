"""Solid shapes as implicit functions: negative inside, roughly a signed distance in mm near the surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from skimage.measure import marching_cubes

from handpipe.core import Array, IntArray

Implicit = Callable[[Array], Array]
"""Values (n,) of points (n, 3)."""


def ellipsoid(centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Implicit:
    """Ellipsoid along the axes; first-order distance |k| (|k| - 1) / |grad|."""
    c, r = np.array(centre), np.array(radii)

    def value(x: Array) -> Array:
        scaled = (x - c) / r
        k = np.linalg.norm(scaled, axis=1)
        return k * (k - 1.0) / np.maximum(np.linalg.norm(scaled / r, axis=1), 1e-9)

    return value


def round_cone(
    start: tuple[float, float, float], end: tuple[float, float, float], radius_start: float, radius_end: float
) -> Implicit:
    """Capsule whose radius goes linearly from one end to the other."""
    a, b = np.array(start), np.array(end)

    def value(x: Array) -> Array:
        t = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = a + t[:, None] * (b - a)
        return np.linalg.norm(x - nearest, axis=1) - (radius_start + t * (radius_end - radius_start))

    return value


def rounded_box(
    centre: tuple[float, float, float], half: tuple[float, float, float], rounding: float
) -> Implicit:
    """Box along the axes of half lengths `half`, its edges rounded by a radius; an exact distance."""
    c, inner = np.array(centre), np.array(half) - rounding

    def value(x: Array) -> Array:
        beyond = np.abs(x - c) - inner
        return (
            np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0) - rounding
        )

    return value


def smooth_union(shapes: list[Implicit], blend: float) -> Implicit:
    """Union of shapes rounded over `blend` mm where they meet (polynomial smooth minimum)."""

    def value(x: Array) -> Array:
        result = shapes[0](x)
        for shape in shapes[1:]:
            other = shape(x)
            h = np.maximum(blend - np.abs(result - other), 0.0) / blend
            result = np.minimum(result, other) - 0.25 * blend * h**2
        return result

    return value


def carved(
    shape: Implicit, obstacle: Implicit, gap: float, blend: float = 0.6, depth: float = 3.0
) -> Implicit:
    """The shape without its parts closer than `gap` mm to an obstacle, cut at most `depth` mm deep."""

    def value(x: Array) -> Array:
        result = shape(x)
        near = np.flatnonzero(np.abs(result) < depth)
        own, cut = result[near], gap - obstacle(x[near])
        h = np.maximum(blend - np.abs(own - cut), 0.0) / blend
        result[near] = np.maximum(own, cut) + 0.25 * blend * h**2
        return result

    return value


def offset(shape: Implicit, depth: Implicit) -> Implicit:
    """The shape moved inwards by `depth(x)` mm."""
    return lambda x: shape(x) + depth(x)


def triangulate(shape: Implicit, lower: Array, upper: Array, spacing: float) -> tuple[Array, IntArray]:
    """Closed, outward oriented surface of the zero level in a box; vertices (n, 3), triangles (k, 3)."""
    count = np.ceil((upper - lower) / spacing).astype(int) + 1
    axes = [low + spacing * np.arange(n) for low, n in zip(lower, count, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = shape(points).reshape(tuple(count))
    # Zeros on grid nodes would give triangles without area.
    values = np.where(np.abs(values) < 1e-3 * spacing, 1e-3 * spacing, values)
    vertices, triangles, _, _ = marching_cubes(
        values, 0.0, spacing=(spacing,) * 3, gradient_direction="descent"
    )
    return vertices.astype(float) + lower, triangles.astype(np.int64)
