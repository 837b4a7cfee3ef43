"""Handles of closed surfaces: false bridges between parts that touch, and holes through a part.

The skin of a hand has the topology of a sphere. A scanner fuses fingers that touch: each bridge between them
is a handle. Some loops that do not part the surface run around the bridge, others around the hole beside it,
and some around a finger that a bridge holds at its tip: only loops much shorter than a finger's girth are
cut. They are found as Erickson and Whittlesey 2005 find the shortest basis of loops through one vertex: by a
tree of shortest paths, and a tree of triangles that crosses none of these paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from handpipe.core import Array, IntArray
from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.generation.hole_filling import fill_holes
from handpipe.mesh.surfaces.surface import Surface, component_labels

BRIDGE = 25.0  # mm around a bridge that is cut, at most: less than around a child's finger
HOLE = 3.0  # a bridge so many times as long around as a hole is cut rather than the hole filled
PUSH = 0.05  # mean edges by which loops are pushed off the surface to tell around what they run
EACH = 3  # one of so many vertices of a loop is looked at first
WHOLE = 0.99  # of the area, at least, is in one piece beside a cut
RINGS = 4  # of triangles beside a loop that are removed, at most, until the patches do not cut the surface


@dataclass(frozen=True)
class Handle:
    """A handle that was cut.

    Parameters
    ----------
    place : array (3,)
        Its middle in mm.
    around : float
        Length in mm of the shortest loop that was found.
    bridge : bool
        Whether the loop ran around a part of the body; else it ran around a hole, which was filled.
    """

    place: Array
    around: float
    bridge: bool

    def __str__(self) -> str:
        """What was done and where, as a sentence."""
        place = ", ".join(f"{c:.1f}" for c in self.place)
        did = "Cut a bridge" if self.bridge else "Filled a hole through the body"
        return f"{did}, {self.around:.1f} mm around, at ({place}) mm."


def genus(surface: Surface) -> int:
    """The number of handles of a closed surface.

    Parameters
    ----------
    surface : Surface
        Closed surface, in any number of pieces.

    Returns
    -------
    int
    """
    pieces, vertices = int(component_labels(surface.triangles).max()) + 1, len(np.unique(surface.triangles))
    return pieces - (vertices - len(surface.edges()) + len(surface.triangles)) // 2


def without_handles(surface: Surface, longest: float = BRIDGE) -> tuple[Surface, list[Handle]]:
    """Cut a closed surface along short loops that do not part it, until there is none.

    Triangles along the loop are removed, and both rims closed by smooth patches. That cuts a bridge or fills
    a hole, a few edges wide.

    Parameters
    ----------
    surface : Surface
        Closed surface in one piece, in mm.
    longest : float, optional
        Length in mm around a bridge that is cut, at most. Of a hole that is filled it is a third of that.

    Returns
    -------
    surface : Surface
        Closed surface; itself if it has no such handle. Longer handles are left, as are those where no cut
        succeeds: see `genus`.
    handles : list of Handle
        What was cut, in order.
    """
    found: list[Handle] = []
    while genus(surface) > 0:
        best = _cheapest(_Graph(surface))
        if best is None or _cost(best) > longest:
            break
        handle, loop = best
        cut = _cut(surface, loop)
        if cut is None:
            break
        found.append(handle)
        surface = cut
    return surface, found


def _cheapest(graph: _Graph) -> tuple[Handle, IntArray] | None:
    """The cheapest loop around a bridge or a hole, as vertices in order; None if none is found.

    A loop around a hole passes over each bridge beside it: loops through some of its vertices are looked at,
    then those through all vertices of the cheapest one.
    """
    basis = graph.loops(0)
    known = graph.handles(basis, basis)
    best, asked = min(known, key=_cost, default=None), {0}
    ahead = list(np.unique(np.concatenate([loop[::EACH] for loop in basis])))
    while ahead:
        asked |= {*ahead}
        loops = [loop for root in ahead for loop in graph.loops(int(root))]
        known = [*graph.handles(loops, basis), *known]
        best = min(known, key=_cost, default=None)
        ahead = [] if best is None else [v for v in best[1] if v not in asked]
    return best


def _cost(found: tuple[Handle, IntArray]) -> float:
    """Length by which loops are compared."""
    return found[0].around * (1.0 if found[0].bridge else HOLE)


class _Graph:
    """A closed surface's edges, and the two triangles at each."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._ends, self._lengths = surface.edges(), surface.edge_lengths()
        n = len(surface.vertices)
        both = np.concatenate([self._ends, self._ends[:, ::-1]])
        self._paths = sparse.csr_matrix((np.tile(self._lengths, 2), both.T), shape=(n, n))
        order = np.argsort(surface.edge_numbers().ravel(), kind="stable")
        self._faces = (order // 3).reshape(-1, 2)
        self._outwards = PUSH * self._lengths.mean() * surface.vertex_normals()

    def handles(self, loops: list[IntArray], basis: list[IntArray]) -> list[tuple[Handle, IntArray]]:
        """Loops of vertices that run around one bridge or hole, each with what it runs around.

        A loop that is drawn in to the body and links with no loop of a basis that is drawn out of it is the
        rim of a cut through the body; for a loop around a hole it is the other way about.
        """
        found = []
        out, into = ([self._pushed(loop, sign) for loop in basis] for sign in (1, -1))
        for loop in loops:
            places = self._surface.vertices[loop]
            around = float(np.linalg.norm(places - np.roll(places, -1, axis=0), axis=1).sum())
            for bridge, others, sign in ((True, out, -1), (False, into, 1)):
                at = self._pushed(loop, sign)
                if not any(_linking(at, other) for other in others):
                    found.append((Handle(places.mean(axis=0), around, bridge), loop))
                    break
        return found

    def _pushed(self, loop: IntArray, sign: int) -> Array:
        """Places of a loop, pushed off the surface: 1 outwards, -1 inwards."""
        return np.asarray(self._surface.vertices[loop] + sign * self._outwards[loop])

    def loops(self, root: int) -> list[IntArray]:
        """Loops through a vertex, two for each handle: no combination of them parts the surface.

        The part of the way to the root that both ways of a loop have is left out.
        """
        far, before = dijkstra(self._paths, indices=root, return_predecessors=True)
        a, b = self._ends.T
        off = (before[a] != b) & (before[b] != a)
        count = len(self._surface.triangles)
        around = (far[a] + far[b] + self._lengths)[off]
        # Long loops are crossed first, so that short ones are left. A graph's weights are positive.
        weights = around.max() + 1.0 - around
        faces = self._faces[off]
        tree = minimum_spanning_tree(sparse.csr_matrix((weights, faces.T), shape=(count, count))).tocoo()
        crossed = _keys(np.column_stack([tree.row, tree.col]), count)
        left = self._ends[off][~np.isin(_keys(faces, count), crossed)]
        return [_loop(before, int(a), int(b)) for a, b in left]


def _linking(one: Array, other: Array) -> int:
    """How often two closed polygons (k, 3) and (m, 3) link: solid angles over pairs of edges, by Gauss."""
    a = other[None] - one[:, None]
    b = other[None] - np.roll(one, -1, axis=0)[:, None]
    c, d = (np.roll(x, -1, axis=1) for x in (b, a))
    total = _half_angles(a, b, c) + _half_angles(c, d, a)
    return int(np.rint(total.sum() / (2 * np.pi)))


def _half_angles(a: Array, b: Array, c: Array) -> Array:
    """Half of the solid angles of triangles with corners (…, 3), signed (Van Oosterom and Strackee 1983)."""
    u, v, w = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    dots = (a * b).sum(axis=-1) * w + (b * c).sum(axis=-1) * u + (c * a).sum(axis=-1) * v
    return np.asarray(np.arctan2((a * np.cross(b, c)).sum(axis=-1), u * v * w + dots))


def _keys(pairs: IntArray, count: int) -> IntArray:
    """One number for each unordered pair (n, 2) of numbers below count."""
    low, high = np.sort(pairs, axis=1).T
    return np.asarray(low * np.int64(count) + high)


def _loop(before: IntArray, a: int, b: int) -> IntArray:
    """The loop of an edge and the ways from its ends to where they meet."""
    one, other = _way(before, a), _way(before, b)
    while len(one) > 1 and len(other) > 1 and one[-2] == other[-2]:
        one, other = one[:-1], other[:-1]
    return np.array([*one, *other[-2::-1]], dtype=np.int64)


def _way(before: IntArray, vertex: int) -> list[int]:
    way = [vertex]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way


def _cut(surface: Surface, loop: IntArray) -> Surface | None:
    """The surface without the triangles along a loop, its rims closed; None if no such surface is right."""
    band = np.zeros(len(surface.vertices), dtype=bool)
    band[loop] = True
    before = genus(surface)
    for _ in range(RINGS):
        beside = band[surface.triangles].any(axis=1)
        band[surface.triangles[beside]] = True
        left = Surface(surface.vertices, surface.triangles[~beside])
        body = left.largest_component()
        if body.area() < WHOLE * left.area():
            continue
        filled = fill_holes(body.compact(), [])
        if filled.is_closed() and genus(filled) < before and not cuts_itself(filled):
            return filled
    return None
