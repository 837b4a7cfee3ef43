"""Manufactured flesh about the finger: tets that a known map bends with the bones and pushes sideways."""

from __future__ import annotations

import numpy as np
from tests.tissues.muscles.shapes import box

from handpipe.core.arrays import Array, IntArray
from handpipe.core.layers import Shape
from handpipe.tissues.tendons.rods.rest import RestTendon
from handpipe.tissues.tendons.rods.rod import lay

from .finger import course, hinge

BLEND = 4.0  # mm to either side of a hinge over which the flesh turns
PALM, WIDTH = -5.0, 12.0  # x about which flesh is pushed, and how far


def shift(x: Array, push: float) -> Array:
    """How far (n,) in mm flesh at x is pushed along y."""
    return push * np.exp(-(((x - PALM) / WIDTH) ** 2))


def pushed(middle: float, distal: float, push: float) -> Shape:
    """The flesh in a pose of flexion angles in rad, pushed by `push` mm."""
    rest, tets = _grid()
    moved = rest + np.outer(shift(rest[:, 0], push), [0.0, 1.0, 0.0])
    for joint, angle in ((60.0, distal), (30.0, middle)):
        share = np.clip((rest[:, 0] - joint + BLEND) / (2 * BLEND), 0.0, 1.0)
        for part in np.unique(share):
            here = share == part
            moved[here] = hinge(joint, part * angle)(moved[here])
    return Shape(rest, moved, tets)


def pushed_rod(rest: RestTendon, middle: float, distal: float, push: float) -> Array:
    """The rod of the rest tendon's length along its course in that flesh."""
    line = course(middle, distal)
    on_base = np.arange(len(line)) >= np.flatnonzero(line[:, 0] > 29.0).max(initial=0)
    line[on_base, 1] += shift(line[on_base, 0], push)
    return lay(line, rest.length, len(rest.x) - 1, np.array([-1.0, 0, 0]))


def _grid() -> tuple[Array, IntArray]:
    mesh = box((65, 4, 4), (130.0, 16.0, 12.0))
    return mesh.vertices - [40.0, 8.0, 0.0], mesh.tets
