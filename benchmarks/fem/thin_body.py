"""A closed thin body of the size of a hand's fat: between a skin and the organs inside it (Zheng 2022 Table
1)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray, artifacts
from handpipe.mesh.generation import Grid, isosurface, remesh, smooth_minimum, tetrahedralise
from handpipe.mesh.surfaces import concatenate
from handpipe.mesh.tets import TetMesh

log = logging.getLogger(__name__)

KIND = "benchmark thin body"
PAPER_VERTICES, PAPER_TETS = 48_672, 227_314  # Zheng 2022 Table 1, fat
EDGE, DEPTH_EDGE = 1.8, 0.92  # mm on the surfaces and in the depth: give about the paper's numbers
GRID_EDGE = 0.9  # mm, of the grid that the surfaces are found on
LEAST_THICKNESS, MOST_THICKNESS = 1.5, 5.0  # mm: back of the hand, pads of palm and fingers
JOINT = np.array([88.0, 0.0, -1.0])  # a point of the axis of flexion, which is along y
BLEND = 14.0  # mm on either side of the axis over which the inside turns from one bone to the other

# Two ends (3,) in mm and the radii there. x distal, y radial, z dorsal.
CAPSULES = [
    *[((10.0, y, 0.0), (88.0, 1.15 * y, 0.0), 12.0, 11.5) for y in (-27.0, -9.0, 9.0, 27.0)],
    *[
        ((88.0, 1.15 * y, 0.0), (88.0 + length, 1.3 * y, -2.0), 10.0, 7.5)
        for y, length in ((-27.0, 58.0), (-9.0, 74.0), (9.0, 82.0), (27.0, 72.0))
    ],
    ((25.0, 30.0, -8.0), (62.0, 52.0, -14.0), 14.0, 10.0),
    ((62.0, 52.0, -14.0), (92.0, 62.0, -16.0), 10.0, 8.0),
]


@dataclass(frozen=True)
class ThinBody:
    """A tetrahedral mesh and the mask (n,) of the vertices on its inner surface."""

    mesh: TetMesh
    inner: BoolArray

    def flexed(self, angle: float) -> Array:
        """All vertices (n, 3) turned about the joint's axis by `angle` (rad) times a smooth share of it.

        What is distal of the joint moves as one bone, what is proximal rests: two bones, smoothly skinned.
        Only the inner surface is to be clamped there.
        """
        x = self.mesh.vertices
        s = np.clip((x[:, 0] - JOINT[0]) / (2 * BLEND) + 0.5, 0.0, 1.0)
        on_finger = x[:, 1] < 45.0  # the thumb rests
        turn = angle * np.where(on_finger, s * s * (3 - 2 * s), 0.0)
        along, up = x[:, 0] - JOINT[0], x[:, 2] - JOINT[2]
        out = x.copy()
        out[:, 0] = JOINT[0] + np.cos(turn) * along + np.sin(turn) * up
        out[:, 2] = JOINT[2] - np.sin(turn) * along + np.cos(turn) * up
        return out


def thin_body(cache: str | Path, scale: float = 1.0) -> ThinBody:
    """The body, from the file `cache` where that exists; edges are `scale` times the paper's size."""
    if Path(cache).exists():
        data = artifacts.read(cache, KIND)
        return ThinBody(TetMesh(data["vertices"], data["tets"]), data["inner"].astype(bool))
    body = make_thin_body(scale)
    artifacts.write(
        cache,
        {"vertices": body.mesh.vertices, "tets": body.mesh.tets, "inner": body.inner},
        kind=KIND,
        units={"vertices": "mm"},
    )
    return body


def make_thin_body(scale: float = 1.0) -> ThinBody:
    """Mesh the body anew: its two surfaces from implicit functions, the depth by the project's mesher."""
    ends = np.array([[a, b] for a, b, _, _ in CAPSULES]).reshape(-1, 3)
    grid = Grid.around(ends, 18.0, GRID_EDGE)
    points = grid.points()
    skin = _distance(points)
    outer = remesh(isosurface(skin, grid), scale * EDGE)
    inside = remesh(isosurface(skin + _thickness(points), grid), scale * EDGE)
    mesh = tetrahedralise(concatenate([outer, inside.flipped()]), scale * DEPTH_EDGE)
    inner = np.zeros(len(mesh.vertices), dtype=bool)
    inner[len(outer.vertices) : len(outer.vertices) + len(inside.vertices)] = True
    log.info("thin body: %d vertices, %d tets", len(mesh.vertices), len(mesh.tets))
    return ThinBody(mesh, inner)


def _distance(points: Array) -> Array:
    """About the signed distance (n,) in mm to the skin: tapered capsules, smoothly united."""
    found = np.full(len(points), np.inf)
    for start, end, first, last in CAPSULES:
        axis = np.subtract(end, start)
        share = np.clip((points - start) @ axis / (axis @ axis), 0.0, 1.0)
        distance = np.linalg.norm(points - start - share[:, None] * axis, axis=1)
        found = smooth_minimum(found, distance - first - share * (last - first), 4.0)
    return found


def _thickness(points: Array) -> Array:
    """Thickness (n,) in mm: most on the palmar side, least on the back and about the finger's joints."""
    palmar = 0.5 - 0.5 * np.tanh((points[:, 2] + 1.0) / 5.0)
    joints = 0.35 * np.cos(2 * np.pi * (points[:, 0] - JOINT[0]) / 32.0) ** 2
    share = palmar * (1.0 - joints)
    fingers = 1.0 / (1.0 + np.exp((points[:, 0] - 100.0) / 4.0))  # fingers are thinner than the palm
    return LEAST_THICKNESS + share * (MOST_THICKNESS - LEAST_THICKNESS) * (0.6 + 0.4 * fingers)
