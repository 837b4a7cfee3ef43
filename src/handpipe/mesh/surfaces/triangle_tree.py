"""Trees of boxes around triangles, which find the closest places on a surface, and where rays leave it.

The order of triangles in a tree is found once for all shapes of a surface; for each shape only the boxes are
computed. Results do not depend on that order: the closest triangle is the one of least distance as computed,
and of several the first.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.core import Array, BoolArray, IntArray

LEAF = 4  # triangles in a leaf, at most
DEPTH = 64  # of a tree, at most: each level halves the number of triangles
ROUNDING = 1e-12  # of a squared distance: boxes that are no nearer are not opened
BEHIND = 1e-9  # mm before its start where a ray may meet a triangle: starts on it count
BESIDE = 1e-9  # of a triangle's barycentric coordinates: no ray slips between two triangles


@njit(cache=True)
def ordered(vertices: Array, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Order (t,) of triangles in a tree, and its nodes (m, 3): second child or -1, first and last triangle.

    A node's first child follows it. Nodes are halved across the longest side of their triangles' middles.
    """
    count = len(corners)
    middles = np.empty((count, 3))
    for t in range(count):
        for k in range(3):
            middles[t, k] = (
                vertices[corners[t, 0], k] + vertices[corners[t, 1], k] + vertices[corners[t, 2], k]
            )
    order = np.arange(count)
    nodes = np.empty((max(2 * count, 1), 3), dtype=np.int64)
    pending = np.empty(
        (2 * DEPTH, 3), dtype=np.int64
    )  # first and last triangle, node whose second child it is
    pending[0] = 0, count, -1
    waiting, made = 1, 0
    while waiting > 0:
        waiting -= 1
        first, last, above = pending[waiting]
        if above >= 0:
            nodes[above, 0] = made
        nodes[made] = -1, first, last
        if last - first > LEAF:
            members = order[first:last]
            widest, width = 0, -1.0
            for k in range(3):
                low = high = middles[members[0], k]
                for t in members:
                    low, high = min(low, middles[t, k]), max(high, middles[t, k])
                if high - low > width:
                    widest, width = k, high - low
            order[first:last] = members[np.argsort(middles[members, widest], kind="mergesort")]
            middle = (first + last) // 2
            pending[waiting] = middle, last, made
            pending[waiting + 1] = first, middle, -1
            waiting += 2
        made += 1
    return order, nodes[:made].copy()


@njit(cache=True)
def boxes_of(vertices: Array, corners: IntArray, order: IntArray, nodes: IntArray) -> Array:
    """Least and largest coordinates (m, 6) of the triangles of each node."""
    boxes = np.empty((len(nodes), 6))
    for node in range(len(nodes) - 1, -1, -1):
        second = nodes[node, 0]
        for k in range(3):
            if second >= 0:
                boxes[node, k] = min(boxes[node + 1, k], boxes[second, k])
                boxes[node, 3 + k] = max(boxes[node + 1, 3 + k], boxes[second, 3 + k])
                continue
            low, high = np.inf, -np.inf
            for at in range(nodes[node, 1], nodes[node, 2]):
                for c in range(3):
                    value = vertices[corners[order[at], c], k]
                    low, high = min(low, value), max(high, value)
            boxes[node, k], boxes[node, 3 + k] = low, high
    return boxes


@njit(cache=True)
def closest_places(
    points: Array,
    vertices: Array,
    corners: IntArray,
    tree: tuple[IntArray, IntArray, Array],
    lines: BoolArray,
) -> tuple[Array, IntArray, Array]:
    """Distances (n,) of points (n, 3), triangles (n,) in which the closest places are, and these (n, 3).

    tree: order, nodes and boxes; lines (t,): triangles without area, which are left out. Each search begins
    with the triangle of the point before, which is often near.
    """
    order, nodes, boxes = tree
    distances, triangles = np.empty(len(points)), np.zeros(len(points), dtype=np.int64)
    closest = np.empty((len(points), 3))
    stack, bounds = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    found = 0
    while found < len(lines) - 1 and lines[found]:
        found += 1
    for i in range(len(points)):
        px, py, pz = points[i]
        best, x, y, z = _closest_in(px, py, pz, vertices, corners, found)
        stack[0], bounds[0], waiting = 0, 0.0, 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if bounds[waiting] > best * (1.0 + ROUNDING):
                continue
            second = nodes[node, 0]
            if second >= 0:
                near, far = node + 1, second
                to_near, to_far = _to_box(px, py, pz, boxes, near), _to_box(px, py, pz, boxes, far)
                if to_far < to_near:
                    near, far, to_near, to_far = far, near, to_far, to_near
                stack[waiting], bounds[waiting] = far, to_far
                stack[waiting + 1], bounds[waiting + 1] = near, to_near
                waiting += 2
                continue
            for at in range(nodes[node, 1], nodes[node, 2]):
                t = order[at]
                if lines[t]:
                    continue
                squared, tx, ty, tz = _closest_in(px, py, pz, vertices, corners, t)
                if squared < best or (squared == best and t < found):
                    best, found, x, y, z = squared, t, tx, ty, tz
        distances[i], triangles[i] = np.sqrt(best), found
        closest[i, 0], closest[i, 1], closest[i, 2] = x, y, z
    return distances, triangles, closest


@njit(cache=True, inline="always")
def _to_box(px: float, py: float, pz: float, boxes: Array, node: int) -> float:
    """Squared distance of a point from a node's box."""
    x = max(boxes[node, 0] - px, px - boxes[node, 3], 0.0)
    y = max(boxes[node, 1] - py, py - boxes[node, 4], 0.0)
    z = max(boxes[node, 2] - pz, pz - boxes[node, 5], 0.0)
    return x * x + y * y + z * z


@njit(cache=True)
def _closest_in(
    px: float, py: float, pz: float, vertices: Array, corners: IntArray, t: int
) -> tuple[float, float, float, float]:
    """Squared distance of a point from a triangle, and the closest place in it (Ericson 2004 §5.1.5)."""
    a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
    ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    bx, by, bz = vertices[b, 0], vertices[b, 1], vertices[b, 2]
    cx, cy, cz = vertices[c, 0], vertices[c, 1], vertices[c, 2]
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    d1 = ux * (px - ax) + uy * (py - ay) + uz * (pz - az)
    d2 = vx * (px - ax) + vy * (py - ay) + vz * (pz - az)
    d3 = ux * (px - bx) + uy * (py - by) + uz * (pz - bz)
    d4 = vx * (px - bx) + vy * (py - by) + vz * (pz - bz)
    d5 = ux * (px - cx) + uy * (py - cy) + uz * (pz - cz)
    d6 = vx * (px - cx) + vy * (py - cy) + vz * (pz - cz)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        x, y, z = ax, ay, az
    elif d3 >= 0.0 and d4 <= d3:
        x, y, z = bx, by, bz
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        share = d1 / max(d1 - d3, 1e-300)
        x, y, z = ax + share * ux, ay + share * uy, az + share * uz
    elif d6 >= 0.0 and d5 <= d6:
        x, y, z = cx, cy, cz
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        share = d2 / max(d2 - d6, 1e-300)
        x, y, z = ax + share * vx, ay + share * vy, az + share * vz
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        share = (d4 - d3) / max((d4 - d3) + (d5 - d6), 1e-300)
        x, y, z = bx + share * (cx - bx), by + share * (cy - by), bz + share * (cz - bz)
    else:
        part = 1.0 / max(va + vb + vc, 1e-300)
        second, third = vb * part, vc * part
        x = ax + ux * second + vx * third
        y = ay + uy * second + vy * third
        z = az + uz * second + vz * third
    return (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2, x, y, z


@njit(cache=True)
def ways_out(
    starts: Array,
    directions: Array,
    most: float,
    vertices: Array,
    corners: IntArray,
    tree: tuple[IntArray, IntArray, Array],
) -> tuple[Array, IntArray]:
    """Lengths (n,) of rays to where they first leave a surface, and the triangles (n,) there.

    starts, directions: (n, 3), the directions with unit length; most: length of a ray; tree: order, nodes and
    boxes. A ray leaves where it meets a triangle from behind. The length is infinite, and the triangle -1, of
    one that does not.
    """
    order, nodes, boxes = tree
    lengths, triangles = np.full(len(starts), most), np.full(len(starts), -1)
    stack = np.empty(DEPTH, dtype=np.int64)
    for i in range(len(starts)):
        stack[0], waiting = 0, 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if not _meets(starts[i], directions[i], boxes[node], lengths[i]):
                continue
            second = nodes[node, 0]
            if second >= 0:
                stack[waiting], stack[waiting + 1] = second, node + 1
                waiting += 2
                continue
            for at in range(nodes[node, 1], nodes[node, 2]):
                t = order[at]
                length = _length_out(starts[i], directions[i], vertices, corners[t])
                if length < lengths[i]:
                    lengths[i], triangles[i] = length, t
        if triangles[i] < 0:
            lengths[i] = np.inf
    return lengths, triangles


@njit(cache=True)
def _meets(start: Array, direction: Array, box: Array, most: float) -> bool:
    """Whether a ray meets a box (6,) before a length."""
    first, last = -BEHIND, most
    for k in range(3):
        if direction[k] == 0.0:
            if start[k] < box[k] or start[k] > box[3 + k]:
                return False
            continue
        a, b = (box[k] - start[k]) / direction[k], (box[3 + k] - start[k]) / direction[k]
        first, last = max(first, min(a, b) - BEHIND), min(last, max(a, b) + BEHIND)
    return first <= last


@njit(cache=True)
def _length_out(start: Array, direction: Array, vertices: Array, corners: IntArray) -> float:
    """Length of a ray to a triangle that it meets from behind; else infinite (Moeller and Trumbore 1997)."""
    a = vertices[corners[0]]
    u, v, w = vertices[corners[1]] - a, vertices[corners[2]] - a, start - a
    p = np.cross(direction, v)
    det = np.dot(u, p)
    if det >= 0.0:  # it meets the front, or passes along
        return np.inf
    second = np.dot(w, p) / det
    q = np.cross(w, u)
    third = np.dot(direction, q) / det
    if second < -BESIDE or third < -BESIDE or second + third > 1.0 + BESIDE:
        return np.inf
    length = np.dot(v, q) / det
    return length if length >= -BEHIND else np.inf
