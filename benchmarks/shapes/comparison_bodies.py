"""The bent, growing beam and the stretched muscle with one tendon (Wang 2021 Fig. 5.3, 5.13, 5.24, 5.25).

Rods of round cross-sections, smooth all round, whose shapes to be found come from closed-form maps. Meshes
are nested: dividing cells in two or three keeps every vertex of the coarsest, so marks are the same points
whatever the refinement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from handpipe.core import Array, IntArray
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs

Map = Callable[[Array], Array]

LAYERS, RINGS = 12, 2  # of the coarsest mesh
BEAM, MUSCLE = 60.0, 45.0  # mm, lengths at rest
QUARTERS = np.array([0, 3, 6, 9])  # of the twelve vertices round the coarsest cross-section


@dataclass(frozen=True)
class Body:
    """A template, its true shape (n, 3), vertices attached at one end (t,), and marked ones (r,).

    Marks are on the side, and the last ones at the other end. side: vertices of the surface more than a
    coarsest cell away from the rims of the end faces.
    """

    mesh: TetMesh
    truth: Array
    attached: IntArray
    marked: IntArray
    side: IntArray

    @property
    def wanted(self) -> TetMesh:
        return self.mesh.moved(self.truth)

    def pairs(self, vertices: IntArray) -> Pairs:
        """Vertices at rest and where they belong."""
        return Pairs(self.mesh.vertices[vertices], self.truth[vertices])


def beam(refinements: int) -> Body:
    """A beam with rounded edges, bent by a right angle and twice as wide in the middle."""
    return rod_body(refinements, _beam_at_rest, _beam_in_truth, {3: 0, 6: 0, 9: 0})


def muscle(refinements: int) -> Body:
    """A muscle whose tendon is stretched to twice its length while its belly widens."""
    return rod_body(refinements, _muscle_at_rest, _muscle_in_truth, {2: 0, 5: 1, 7: 2, 9: 0})


BODIES: dict[str, Callable[[int], Body]] = {"beam": beam, "muscle": muscle}


def rod_body(
    refinements: int, at_rest: Map, in_truth: Map, marks: dict[int, int], layers: int = LAYERS
) -> Body:
    """A rod by maps of its places (n, 3), see `rod`.

    marks: coarsest layers with four marks each, and by how many vertices these are turned.
    """
    fine = 1 + refinements
    places, tets = rod(RINGS * fine, layers * fine)
    mesh = TetMesh(at_rest(places), tets)
    coarse = rod(RINGS, layers)[0]
    number = {tuple(place): n for n, place in enumerate(np.round(places, 9))}
    index = np.array([number[tuple(place)] for place in np.round(coarse, 9)])
    layer = np.round(coarse[:, 0] * layers).astype(int)
    around = np.flatnonzero(layer == 0)[-6 * RINGS :]
    stride = int((layer == 0).sum())
    end = np.concatenate([[0], around[::2]])
    marked = [around[(QUARTERS + turn) % (6 * RINGS)] + stride * k for k, turn in marks.items()]
    outer = mesh.boundary_vertices()
    along = places[outer, 0] * layers
    return Body(
        mesh=mesh,
        truth=in_truth(places),
        attached=index[end],
        marked=index[np.concatenate([*marked, end + stride * layers])],
        side=outer[(along > 1) & (along < layers - 1)],
    )


def rod(rings: int, layers: int) -> tuple[Array, IntArray]:
    """Places (n, 3) (share of the length, point of the unit disc) and tets of a rod, its sides a lattice.

    Ring k has 6 k vertices. Prisms are cut into three tets along diagonals that ascend in the order of their
    triangle's corners: outwards, and counter-clockwise within a ring.
    """
    k = np.concatenate([np.full(max(6 * ring, 1), ring) for ring in range(rings + 1)])
    j = np.concatenate([np.arange(max(6 * ring, 1)) for ring in range(rings + 1)])
    angle = 2 * np.pi * j / np.maximum(6 * k, 1)
    disc = (k / rings)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    triangles = np.concatenate([_annulus(ring) for ring in range(1, rings + 1)])
    n = len(disc)
    share = np.repeat(np.arange(layers + 1) / layers, n)
    places = np.column_stack([share, np.tile(disc, (layers + 1, 1))])
    low = (triangles[None] + n * np.arange(layers)[:, None, None]).reshape(-1, 3)
    a, b, c = low.T
    cut = [(a, b, c, c + n), (a, b, b + n, c + n), (a, a + n, b + n, c + n)]
    tets = np.concatenate([np.column_stack(corners) for corners in cut])
    negative = TetMesh(places, tets).volumes() < 0
    tets[negative] = tets[negative][:, [0, 2, 1, 3]]
    return places, tets


def _annulus(ring: int) -> IntArray:
    """Triangles between a ring and the one inside it, corners in the order that prisms are cut in."""
    inner, outer = _first(ring - 1), _first(ring)
    found = []
    for sixth in range(6):
        for step in range(ring):
            a = outer + (sixth * ring + step) % (6 * ring)
            b = outer + (sixth * ring + step + 1) % (6 * ring)
            within = inner + (sixth * (ring - 1) + step) % max(6 * (ring - 1), 1)
            found.append((within, a, b))
            if step:
                found.append((inner + (sixth * (ring - 1) + step - 1) % (6 * (ring - 1)), within, a))
    return np.array(found, dtype=np.int64)


def _first(ring: int) -> int:
    return 0 if ring == 0 else 1 + 3 * ring * (ring - 1)


def _beam_at_rest(places: Array) -> Array:
    s, y, z = places.T
    squarish = 6.0 * (1 - 0.04 * np.cos(4 * np.arctan2(z, y)))
    return np.column_stack([BEAM * s, squarish * y, squarish * z])


def _beam_in_truth(places: Array) -> Array:
    x, y, z = _beam_at_rest(places).T
    angle = 0.5 * np.pi * x / BEAM
    arc = BEAM / (0.5 * np.pi)
    wide = y * (1 + np.sin(np.pi * x / BEAM) ** 2)
    return np.column_stack([(arc - z) * np.sin(angle), wide, arc - (arc - z) * np.cos(angle)])


def _muscle_at_rest(places: Array) -> Array:
    s, y, z = places.T
    radius = 2.0 + 4.0 * _rise(s, 0.25, 0.6) - 3.0 * _rise(s, 0.7, 1.0)
    return np.column_stack([MUSCLE * s, radius * y, 0.9 * radius * z])


def _muscle_in_truth(places: Array) -> Array:
    s = places[:, 0]
    _, y, z = _muscle_at_rest(places).T
    knots = np.linspace(0.0, 1.0, 401)
    along = MUSCLE * CubicSpline(knots, 2.0 - _rise(knots, 0.2, 0.6)).antiderivative()(s)
    belly = _rise(s, 0.3, 0.55) - _rise(s, 0.75, 1.0)
    bow = 4.0 * np.sin(np.pi * s)
    return np.column_stack([along, (1 + 0.7 * belly) * y + bow, (1 + 0.2 * belly) * z])


def _rise(s: Array, begin: float, end: float) -> Array:
    """From 0 to 1, twice differentiable."""
    t = np.clip((s - begin) / (end - begin), 0.0, 1.0)
    return t**3 * (10 - 15 * t + 6 * t**2)
