"""What may collide in a frame: muscles' surfaces and the bones near them, and where they cross."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.contact import Barrier, CollidingPairs
from handpipe.mesh.contact import crossings, distance_to, ipctk
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.tissues.muscles.muscle import Muscle
from handpipe.tissues.muscles.separation.overlap import Collider

REACH = 1.0  # mm from a muscle's vertices within which bones take part
HELD = 0.5  # weight of the tets' corners that bones hold, above which a surface vertex goes with them


@dataclass(frozen=True)
class Crossings:
    """Edges (c, 2) that pass through triangles (c, 3) of another body, and the two bodies' indices (c,)."""

    edges: IntArray
    triangles: IntArray
    bodies: IntArray


@dataclass(frozen=True)
class Bodies:
    """Collision surface of muscles and bones.

    Its vertices are copies of the muscles' surface vertices, muscle by muscle, then those of bones. Triangles
    with a vertex that a bone holds have copies of their own, which are tied: they collide with no bone, with
    no other tied triangle, and not with their own muscle.

    originals: of each copy (k,) the free copy of the same surface vertex.
    names: of the bodies, muscles first; operator (k, n): from mesh vertices to copies; body, tied: of each
    vertex; bones: vertices (o, 3) and triangles, numbered from zero.
    """

    names: tuple[str, ...]
    operator: sparse.csr_matrix
    triangles: IntArray
    originals: IntArray
    body: IntArray
    tied: BoolArray
    bones: tuple[Array, IntArray]

    @staticmethod
    def of(
        muscles: Sequence[Muscle],
        surfaces: Sequence[sparse.csr_matrix],
        bones: Mapping[str, Surface],
        x: Array,
    ) -> Bodies:
        """Bodies of muscles at x (n, 3), whose surfaces are `surfaces @ x`, and of posed bones."""
        operators, triangles, body, tied, originals = list[sparse.csr_matrix](), [], [], [], []
        first = 0
        for index, (muscle, surface) in enumerate(zip(muscles, surfaces, strict=True)):
            own, faces = Collider(muscle.name, muscle.body.surface, _held(muscle)).copies
            operators.append(surface[own])
            triangles.append(faces + first)
            originals.append(own + first)
            body.append(np.full(len(own), index))
            tied.append(np.arange(len(own)) >= surface.shape[0])
            first += len(own)
        operator = sparse.vstack(operators, format="csr")
        known = _near(bones, operator @ x)
        vertices, faces = _joined([s for _, s in known])
        body += [np.full(len(s.vertices), len(muscles) + i) for i, (_, s) in enumerate(known)]
        tied.append(np.ones(len(vertices), dtype=bool))
        names = (*(m.name for m in muscles), *(name for name, _ in known))
        all_triangles, copied, bodies, bound = map(np.concatenate, (triangles, originals, body, tied))
        return Bodies(names, operator, all_triangles, copied, bodies, bound, (vertices, faces))

    @property
    def count(self) -> int:
        """Number of copies of muscles' vertices."""
        return int(self.operator.shape[0])

    @cached_property
    def faces(self) -> IntArray:
        """All triangles (t, 3)."""
        return np.concatenate([self.triangles, self.bones[1] + self.count])

    def surface(self, x: Array) -> Surface:
        """The collision surface with mesh vertices at x (n, 3)."""
        return Surface(np.concatenate([self.operator @ x, self.bones[0]]), self.faces)

    def allowed(self, itself: bool) -> ipctk.CollisionFilter:
        """Which pairs of vertices may collide; itself: also free ones of one muscle."""
        patches = ipctk.make_vertex_patches_filter
        tied = self.tied.astype(np.int32)
        not_both_tied = patches(np.where(self.tied, 0, 1 + np.arange(len(tied))).astype(np.int32))
        apart = patches(self.body.astype(np.int32))
        return not_both_tied & (apart | ~patches(tied)) if itself else not_both_tied & apart

    def crossings(self, x: Array, itself: bool = False) -> Crossings:
        """Where bodies cross one another with mesh vertices at x (n, 3); itself: and muscles themselves."""
        surface = self.surface(x)
        found = crossings(surface, self.allowed(itself))
        edges, triangles = surface.edges()[found[:, 0]], self.faces[found[:, 1]]
        return Crossings(
            edges, triangles, np.column_stack([self.body[edges[:, 0]], self.body[triangles[:, 0]]])
        )

    def depths(self, x: Array, found: Crossings, distances: Mapping[str, Distance]) -> Array:
        """Depth (b,) in mm by body, of the deepest vertex of crossing edges and triangles in the other body.

        distances: to bones by name, as posed as here.
        """
        surface, deepest = self.surface(x), np.zeros(len(self.names))
        known: dict[int, Distance] = {}
        if not len(found.edges):
            return deepest
        for one, other in np.unique(np.concatenate([found.bodies, found.bodies[:, ::-1]]), axis=0):
            if other not in known:
                own = distances.get(self.names[other])
                known[other] = own or distance_to(self._alone(surface, other))
            here = (np.sort(found.bodies, axis=1) == sorted((one, other))).all(axis=1)
            ids = np.unique(np.concatenate([found.edges[here].ravel(), found.triangles[here].ravel()]))
            points = surface.vertices[ids[(self.body[ids] == one) & ~self._bound[ids]]]
            depth = known[other].depths(points).max(initial=0.0) if len(points) else 0.0
            deepest[[one, other]] = np.maximum(deepest[[one, other]], depth)
        return deepest

    @cached_property
    def _bound(self) -> BoolArray:
        """Tied copies (k + o,) of muscles: what bones hold may lie in them."""
        return self.tied & (np.arange(len(self.tied)) < self.count)

    def _alone(self, surface: Surface, muscle: int) -> Surface:
        """The closed surface of one muscle: without tied copies, which have the places of others."""
        own = np.flatnonzero((self.body == muscle) & ~self.tied)
        same = self.originals[self.triangles[(self.body[self.triangles[:, 0]] == muscle)]]
        return Surface(surface.vertices[own], same - own[0])

    def barrier(self, x: Array, rest: Array, distance: float, stiffness: float) -> Barrier:
        """The barrier between all that may collide, from x (n, 3) without crossings."""
        pairs = CollidingPairs(allowed=self.allowed(True), rest=rest)
        obstacle = self.bones if len(self.bones[0]) else None
        return Barrier(self.operator, self.triangles, x, distance, stiffness, obstacle=obstacle, pairs=pairs)

    def place(self, x: Array, found: Crossings) -> str:
        """Bodies that cross, most crossings first, and where, in words."""
        pairs, counts = np.unique(np.sort(found.bodies, axis=1), axis=0, return_counts=True)
        first = pairs[np.argmax(counts)]
        most = (np.sort(found.bodies, axis=1) == first).all(axis=1)
        middle = np.median(self.surface(x).vertices[found.edges[most]].reshape(-1, 3), axis=0)
        names = " and ".join(self.names[i] for i in dict.fromkeys(first.tolist()))
        place = ", ".join(f"{c:.1f}" for c in middle)
        return f"{len(found.edges)} edges through triangles, most of {names} around ({place}) mm"


def _held(muscle: Muscle) -> IntArray:
    """Surface vertices that go with a bone: the firm ones, and those that can hardly move from them."""
    corners = np.unique(muscle.anchors.indices)
    weight = np.asarray(muscle.body.matrix[:, corners].sum(axis=1)).ravel()
    return np.union1d(muscle.firm, np.flatnonzero(weight > HELD)).astype(np.int64)


def _near(bones: Mapping[str, Surface], points: Array) -> list[tuple[str, Surface]]:
    """Names and parts of bones within reach of points (k, 3)."""
    tree, found = cKDTree(points), []
    for name, bone in bones.items():
        corners = bone.vertices[bone.triangles]
        centres = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centres[:, None], axis=2).max()
        near = np.isfinite(tree.query(centres, distance_upper_bound=REACH + 2 * radius)[0])
        if near.any():
            chosen, faces = np.unique(bone.triangles[near], return_inverse=True)
            found.append((name, Surface(bone.vertices[chosen], faces.reshape(-1, 3))))
    return found


def _joined(surfaces: Sequence[Surface]) -> tuple[Array, IntArray]:
    """Vertices and triangles of all."""
    starts = np.cumsum([0, *(len(s.vertices) for s in surfaces)])
    vertices = [np.zeros((0, 3)), *(s.vertices for s in surfaces)]
    faces = [s.triangles + a for s, a in zip(surfaces, starts, strict=False)]
    return np.concatenate(vertices), np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces])
