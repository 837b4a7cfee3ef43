"""Contact of muscles with bones and with one another, and their sliding on neighbours (Zheng 2022 §4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy import sparse

from handpipe.core import Array
from handpipe.fem.contact import Contact, Sliding, SurfaceContact, contact_pressures, left_deep
from handpipe.fem.potentials import Potential
from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.surfaces import Distance, Surface, about
from handpipe.tissues.muscles.muscle import Muscle
from handpipe.tissues.muscles.neighbours import Neighbours, SurfacePairs, pairs, sliding_vertices
from handpipe.tissues.muscles.options import SimulationOptions

# Matrix (c, N) to vectors between neighbours, places and normals (c, 3) of planes, stiffnesses (c,)
Planes = tuple[sparse.csr_matrix, Array, Array, Array]

BITE = 0.5  # mm of depth, at most, that one set of planes resolves: more at once throws thin muscles far off
GUARDED = 5.0  # mm from a bone's box within which vertices are kept out of it, until planes are renewed


@dataclass(frozen=True)
class MuscleContacts:
    """Potentials between muscles and what they lie against.

    muscles: the muscles; options: distances and stiffnesses; slides: of pairs of muscles, the vertices of the
    first that slide on the second, and the gaps in mm that they keep.
    """

    muscles: Sequence[Muscle]
    options: SimulationOptions
    slides: Neighbours

    @staticmethod
    def of(
        muscles: Sequence[Muscle], options: SimulationOptions, examples: Sequence[Mapping[str, Surface]]
    ) -> MuscleContacts:
        """Contact of muscles that slide where they lie against one another in neutral and all examples."""
        neutral = {m.name: m.body.surface for m in muscles}
        return MuscleContacts(muscles, options, sliding_vertices([neutral, *examples], options.near))

    def with_bones(
        self, bones: Sequence[Distance], x: Array, free_points: sparse.csr_matrix, margin: float = 0.0
    ) -> list[Potential]:
        """Contact with every bone of the free surface vertices, `free_points @ x`, that are near it.

        margin: mm that they keep off.
        """
        points = free_points @ x
        near = [about(points, bone.surface, GUARDED) for bone in bones]
        contacts = [
            SurfaceContact(free_points[ids], bone, self.options.contact, thickness=margin)
            for ids, bone in zip(near, bones, strict=True)
            if len(ids)
        ]
        return [*SurfaceContact.stacked(contacts)]

    def with_neighbours(
        self, x: Array, surfaces: Sequence[sparse.csr_matrix], margin: float | None = 0.0
    ) -> list[Potential]:
        """Contact and sliding of muscles against one another at their present places, `surfaces @ x`.

        margin: mm that contact keeps them off; None: sliding alone. Vertices that a bone holds go with it and
        push nobody, as in stage 2.
        """
        posed = {m.name: m.body.surface.moved(s @ x) for m, s in zip(self.muscles, surfaces, strict=True)}
        distances = {n: Distance(surface, by_winding=n in self._folded) for n, surface in posed.items()}
        operators = {m.name: s for m, s in zip(self.muscles, surfaces, strict=True)}
        firm = {m.name: m.firm for m in self.muscles}
        touching: list[Planes] = []
        sliding: list[Planes] = []
        for a, b in permutations(operators, 2):
            near = pairs(posed[a], distances[b], self.options.near).without(firm[a])
            if len(near.vertices) == 0:
                continue
            touch, slide = near.within(self.options.touch), near.only(self.slides.get((a, b)))
            if margin is not None:
                # Deep vertices come out of the neighbour by `BITE` before planes are renewed.
                left = left_deep(touch.gaps, touch.normals, BITE) + margin * touch.normals
                stiffness = np.full(len(touch.gaps), self.options.contact)
                touching.append((_apart(touch, operators[a], operators[b]), left, touch.normals, stiffness))
            # Neighbours do not gape: the gap along the normal stays what it was in the known poses.
            kept = slide.rest[:, None] * slide.normals
            stiffness = self.options.sliding * slide.sliding_share(self.options.near)
            sliding.append((_apart(slide, operators[a], operators[b]), kept, slide.normals, stiffness))
        return [*_stacked(Contact, touching), *_stacked(Sliding, sliding)]

    def pressures(self, bones: Sequence[Distance], posed: Sequence[Surface]) -> list[Array]:
        """Pressure (v,) in kPa of bones and other muscles on each muscle's surface."""
        starts = np.cumsum([0, *(len(s.vertices) for s in posed)])
        parts = [slice(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True)]
        together = Surface(
            np.concatenate([s.vertices for s in posed]),
            np.concatenate([s.triangles + a for s, a in zip(posed, starts, strict=False)]),
        )
        identity = sparse.identity(len(together.vertices), format="csr")
        surfaces = [identity[part] for part in parts]
        potentials = [
            *self.with_bones(bones, together.vertices, free_points(self.muscles, surfaces)),
            *self.with_neighbours(together.vertices, surfaces),
        ]
        found = contact_pressures(potentials, together)
        return [found[part] for part in parts]

    @cached_property
    def _folded(self) -> frozenset[str]:
        """Muscles that cut themselves in neutral: far outside of them the sign by normals may be wrong."""
        return frozenset(m.name for m in self.muscles if cuts_itself(m.body.surface))


def free_points(muscles: Sequence[Muscle], surfaces: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Matrix (k, N) from all vertices to those of the muscles' surfaces, (v, N) each, that no bone holds."""
    free = [s[np.delete(np.arange(s.shape[0]), m.firm)] for m, s in zip(muscles, surfaces, strict=True)]
    return sparse.vstack(free, format="csr")


def _apart(near: SurfacePairs, a: sparse.csr_matrix, b: sparse.csr_matrix) -> sparse.csr_matrix:
    """Matrix (c, N) from all vertices to vectors from places of the neighbour to the vertices near them."""
    return a[near.vertices] - near.feet @ b


def _stacked(kind: type[Sliding], planes: Sequence[Planes]) -> list[Potential]:
    """One potential of the planes of all pairs: a hundred small ones cost more than their sums."""
    if not planes:
        return []
    apart, *others = zip(*planes, strict=True)
    return [kind(sparse.vstack(apart, format="csr"), *map(np.concatenate, others))]
