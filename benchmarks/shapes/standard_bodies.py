"""The four standard deformations of Botsch and Sorkine 2008: bump, bent cylinder, twisted bar, bent cactus.

One end of each is attached, the other is moved rigidly as a whole (marks all over it). Everything between is
for the method to find. For bump, cylinder and bar it is compared with what a designer means: a smooth step,
a bend and a twist that are even along the body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.shapes.bodies import bar
from benchmarks.shapes.comparison_bodies import Body, rod
from handpipe.core import Array, BoolArray
from handpipe.mesh.tets import TetMesh

PLATE, HEIGHT = 40.0, 10.0  # mm: width of the plate, height of the bump
RISE = (0.25, 0.8)  # of half the plate's width: where the bump begins to fall, and where it has fallen
LONG, RADIUS = 60.0, 6.0  # mm, of cylinder and bar
CLAMPED = 1 / 6  # of the length at each end
BEND, TWIST, CACTUS = np.radians(120.0), np.radians(135.0), np.radians(70.0)
TRUNK, ARM, THICK = 60.0, 18.0, 6.0  # mm, of the cactus


def bump() -> Body:
    """A plate of 40 mm whose middle is lifted by 10 mm while its rim stays."""
    mesh = bar((20, 20, 2), (PLATE, PLATE, 3.0))
    x = mesh.vertices
    out = np.hypot(x[:, 0] - PLATE / 2, x[:, 1] - PLATE / 2) / (PLATE / 2)
    s = np.clip((out - RISE[0]) / (RISE[1] - RISE[0]), 0.0, 1.0)
    truth = x + HEIGHT * np.outer(1 - s**2 * (3 - 2 * s), [0.0, 0.0, 1.0])
    return _body(mesh, truth, out >= RISE[1], out <= RISE[0])


def cylinder(rings: int = 3, layers: int = 24) -> Body:
    """A cylinder of 60 mm, bent by 120 degrees."""
    places, tets = rod(rings, layers)
    mesh = TetMesh(places * [LONG, RADIUS, RADIUS], tets)
    return _ends(mesh, _bent(mesh.vertices, BEND))


def twisted() -> Body:
    """A square bar of 60 mm, twisted by 135 degrees."""
    mesh = bar((24, 4, 4), (LONG, 2 * RADIUS, 2 * RADIUS))
    mesh = mesh.moved(mesh.vertices - [0.0, RADIUS, RADIUS])
    x, y, z = mesh.vertices.T
    angle = TWIST * _progress(x)
    turned = [x, y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)]
    return _ends(mesh, np.column_stack(turned))


def cactus() -> Body:
    """A trunk with an arm on each side; its top is bent by 70 degrees. The arms are free."""
    mesh = _cactus()
    return _ends(mesh, _bent(mesh.vertices, CACTUS))


STANDARD: dict[str, Callable[[], Body]] = {
    "bump": bump,
    "cylinder": cylinder,
    "twist": twisted,
    "cactus": cactus,
}


def arms(mesh: TetMesh) -> BoolArray:
    """Vertices (n,) of the cactus that are not the trunk's."""
    return np.abs(mesh.vertices[:, 1]) > 0.5 * THICK + 1e-9


def _cactus() -> TetMesh:
    """Trunk along x; arms along y that turn up, in cells of 2 mm."""
    cell = 2.0
    size = (TRUNK, 2 * ARM + THICK, THICK)
    mesh = bar((int(TRUNK / cell), int(size[1] / cell), int(THICK / cell)), size)
    x = mesh.vertices - [0.0, size[1] / 2, THICK / 2]
    middle = x[mesh.tets].mean(axis=1)
    along, side = middle[:, 0], np.abs(middle[:, 1])
    trunk = side < THICK / 2
    reach = side < THICK / 2 + ARM
    low = np.where(middle[:, 1] < 0, 16.0, 24.0)  # mm, where an arm leaves the trunk
    branch = reach & (along > low) & (along < low + THICK)
    tip = reach & (side > THICK / 2 + ARM - THICK) & (along > low) & (along < low + 20.0)
    kept = mesh.tets[trunk | branch | tip]
    used, tets = np.unique(kept, return_inverse=True)
    return TetMesh(np.ascontiguousarray(x[used]), tets.reshape(kept.shape).astype(np.int64))


def _progress(x: Array) -> Array:
    """From 0 to 1 between the clamped ends of a body along x."""
    return np.clip((x / LONG - CLAMPED) / (1 - 2 * CLAMPED), 0.0, 1.0)


def _bent(vertices: Array, angle: float) -> Array:
    """Bent about y, evenly between the clamped ends; the middle line keeps its length."""
    x, y, z = vertices.T
    begin, end = CLAMPED * LONG, (1 - CLAMPED) * LONG
    turn = angle * _progress(x)
    arc = (end - begin) / angle
    before, after = np.minimum(x - begin, 0.0), np.maximum(x - end, 0.0)
    cos, sin = np.cos(turn), np.sin(turn)
    along = begin + before + (arc - z) * sin + after * cos
    return np.column_stack([along, y, arc - (arc - z) * cos + after * sin])


def _ends(mesh: TetMesh, truth: Array) -> Body:
    x = mesh.vertices[:, 0]
    trunk = ~arms(mesh) if np.abs(mesh.vertices[:, 1]).max() > 2 * RADIUS else np.full(len(x), True)
    return _body(mesh, truth, x <= CLAMPED * LONG + 1e-9, trunk & (x >= (1 - CLAMPED) * LONG - 1e-9))


def _body(mesh: TetMesh, truth: Array, still: BoolArray, moved: BoolArray) -> Body:
    outer = mesh.boundary_vertices()
    free = outer[~(still | moved)[outer]]
    return Body(mesh, truth, outer[still[outer]], outer[moved[outer]], free)
