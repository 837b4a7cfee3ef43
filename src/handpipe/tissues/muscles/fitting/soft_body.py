"""A soft body between bones: a surface embedded in tetrahedra, and the surface vertices attached to bones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, IntArray, RigidTransform
from handpipe.fem.linear import factorise
from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.generation import remesh, tetrahedralise
from handpipe.mesh.surfaces import Distance, Surface, same_values
from handpipe.mesh.tets import Embedding, TetMesh, dirichlet_matrix, shape_gradients
from handpipe.shapes.observations import Attached
from handpipe.skeleton.posing import blend, bone_weights

Transforms = Mapping[str, RigidTransform]

ON_BONE = 0.4  # mm from a bone within which a vertex moves with it; farther vertices move otherwise
FEWEST = 3  # vertices that attach an end to a bone
SHORTER = 0.8 ** np.arange(4)  # of the edges of a cage, until it does not cut itself
SPREAD = 0.5  # share of harmonic weights in a blend of bones' motions
TET_EDGE = 1.3  # of the cage's edges
STIFF = 1e6  # of the largest entry of a Laplacian: attached vertices keep their weights


@dataclass(frozen=True)
class SoftBody:
    """A soft body in neutral: a surface that tetrahedra carry, attached to bones.

    Parameters
    ----------
    surface : Surface
        Neutral surface in mm, v vertices.
    mesh : TetMesh
        Neutral tets, n vertices in mm.
    embedding : Embedding
        Places of the surface's vertices in the mesh.
    attachments : dict of str to array (k,)
        Ids of the surface vertices that are attached to each bone.
    visible : array (v,) of bool
        Where the neutral image shows the boundary; elsewhere another muscle lies against it.
    landmarks : dict of str to int
        Surface vertex of each label.
    """

    surface: Surface
    mesh: TetMesh
    embedding: Embedding
    attachments: dict[str, IntArray]
    visible: BoolArray
    landmarks: dict[str, int] = field(default_factory=dict)

    @staticmethod
    def fill(
        surface: Surface,
        attachments: Mapping[str, IntArray],
        edge: float,
        landmarks: Mapping[str, int] | None = None,
    ) -> SoftBody:
        """Fill a surface with tetrahedra of about `edge` mm; the surface may be finer than they are.

        A thin body has finer ones, down to half of `edge`: the radius of a long round body is 2 V / A, and
        edges that are longer would cut its volume away (a hexagon has 0.83 of its circle), or cut themselves.
        Where these cut themselves all the same, as those of a thin ribbon may, they are shorter yet.
        """
        longest = float(np.clip(1.5 * surface.volume() / surface.area(), 0.5 * edge, edge))
        for edge in longest * SHORTER:
            cage = remesh(
                surface, edge
            ).largest_component()  # what is thinner breaks off, and is carried along
            if not cuts_itself(cage):
                break
        mesh = tetrahedralise(cage, TET_EDGE * edge)
        visible = np.ones(len(surface.vertices), dtype=bool)
        visible[np.concatenate(list(attachments.values()))] = False
        embedding = Embedding.embed(surface.vertices, mesh)
        return SoftBody(surface, mesh, embedding, dict(attachments), visible, dict(landmarks or {}))

    @property
    def matrix(self) -> sparse.csr_matrix:
        """Matrix (v, n) that carries the surface."""
        return self.embedding.matrix(len(self.mesh.vertices))

    @property
    def attached_vertices(self) -> IntArray:
        """Attached surface vertices (t,), bone by bone."""
        return np.concatenate([self.attachments[b] for b in self.attachments])

    @property
    def attached_places(self) -> dict[str, Array]:
        """Neutral places (k, 3) of the vertices attached to each bone; none if no vertex is attached."""
        places = {bone: self.surface.vertices[ids] for bone, ids in self.attachments.items()}
        return places if len(self.attached_vertices) else {}

    def on_bones(self, bones: Mapping[str, Surface]) -> SoftBody:
        """The same body, attached only where it lies on its bones; bones: neutral surfaces.

        A muscle springs from tendons and from fat as well, and such an end does not go with the bone it is
        next to. An end of which fewer than `FEWEST` vertices lie on a bone is not attached.
        """
        attachments = {}
        for bone, ids in self.attachments.items():
            near = Distance(bones[bone]).signed(self.surface.vertices[ids])[0] < ON_BONE
            attachments[bone] = ids[near & (near.sum() >= FEWEST)]
        return replace(self, attachments=attachments)

    def targets(self, transforms: Transforms) -> Array:
        """Where the bones take these vertices, (t, 3)."""
        return self.carried(self.surface.vertices[self.attached_vertices], transforms)

    def carried(self, places: Array, transforms: Transforms) -> Array:
        """Places (t, 3) of attached vertices, each moved as its bone is."""
        ends = np.cumsum([len(ids) for ids in self.attachments.values()])[:-1]
        return np.concatenate(
            [transforms[b](p) for b, p in zip(self.attachments, np.split(places, ends), strict=True)]
        )

    def attached(self, transforms: Transforms) -> Attached:
        """The attached vertices at the places to which the bones move them."""
        return Attached(self.matrix[self.attached_vertices], self.targets(transforms))

    def landmarked(self, places: Mapping[str, Array]) -> Attached | None:
        """Landmarks that the body and the image (label -> (3,) mm) both have, if any (Wang 2021 Eq. 5.4)."""
        labels = [label for label in self.landmarks if label in places]
        if not labels:
            return None
        ids = np.array([self.landmarks[label] for label in labels])
        return Attached(self.matrix[ids], np.array([places[label] for label in labels]))

    def seated(self, surface: Surface, transforms: Transforms) -> Surface:
        """A fitted surface with its attached vertices exactly on the bones (Wang 2021 §6.1.4, step 3)."""
        vertices = surface.vertices.copy()
        vertices[self.attached_vertices] = self.targets(transforms)
        return surface.moved(vertices)

    def posed(self, vertices: Array, transforms: Transforms) -> SoftBody:
        """The body with its surface at vertices (v, 3) fitted in a pose, attached ones on the bones."""
        return replace(self, surface=self.seated(self.surface.moved(vertices), transforms))

    def surface_at(self, x: Array) -> Surface:
        """The surface carried by mesh vertices (n, 3)."""
        return self.surface.moved(self.embedding(x))

    def follow(
        self,
        bones: Mapping[str, Surface],
        transforms: Transforms,
        known: tuple[Transforms, Array] | None = None,
        spread: float = SPREAD,
    ) -> Array:
        """Mesh vertices (n, 3) moved by a smooth blend of the motions of the bones that the body attaches to.

        known: transforms and mesh vertices (n, 3) of another pose to start from, in place of neutral.

        Weights by nearness to the bones bend where the joint is; harmonic ones spread the bend over the whole
        length. `spread` is the share of the latter: measured, even shares are nearer to the truth than
        either.
        """
        return self.followed(bones, transforms, [known], [spread])[0]

    def followed(
        self,
        bones: Mapping[str, Surface],
        transforms: Transforms,
        known: Sequence[tuple[Transforms, Array] | None],
        spreads: Sequence[float] = (SPREAD,),
    ) -> list[Array]:
        """What `follow` gives from each of several known poses, for each of several spreads."""
        own = {b: bones[b] for b in self.attachments}
        nearness, harmonic = self._nearness(own), self._harmonic_weights
        still = {b: RigidTransform.identity() for b in own}, self.mesh.vertices
        found = []
        for there, start in (pose or still for pose in known):
            motions = {b: transforms[b] @ there[b].inverse() for b in own}
            found += [blend(start, (1 - s) * nearness + s * harmonic, motions) for s in spreads]
        return found

    def _nearness(self, bones: Mapping[str, Surface]) -> Array:
        """Weights (n, bones) by nearness to neutral bones, kept for the next pose."""
        known = self._last_nearness.get("last")
        if known is None or not all(
            same_values(known[0][name].vertices, bone.vertices) for name, bone in bones.items()
        ):
            known = dict(bones), bone_weights(self.mesh.vertices, bones)
            self._last_nearness["last"] = known
        return known[1]

    @cached_property
    def _last_nearness(self) -> dict[str, tuple[dict[str, Surface], Array]]:
        """The bones for which weights were last asked, and these weights."""
        return {}

    @cached_property
    def _harmonic_weights(self) -> Array:
        return self.harmonic_weights()

    def harmonic_weights(self) -> Array:
        """Weights (n, bones), one at a bone's own attachment, harmonic in between, rows summing to one."""
        vertices, tets = self.mesh.vertices, self.mesh.tets
        gradients = shape_gradients(vertices, tets)
        laplacian = dirichlet_matrix(tets, gradients, self.mesh.volumes(), len(vertices))
        springs = self.matrix[self.attached_vertices]
        owner = np.repeat(np.arange(len(self.attachments)), [len(i) for i in self.attachments.values()])
        stiff = STIFF * abs(laplacian).max()
        system = (laplacian + stiff * springs.T @ springs).tocsr()
        weights = factorise(system).solve(stiff * (springs.T @ np.eye(len(self.attachments))[owner]))
        weights = np.clip(weights, 0.0, 1.0)
        return weights / weights.sum(axis=1, keepdims=True)

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {
            "vertices": self.surface.vertices,
            "triangles": self.surface.triangles,
            "visible": self.visible,
            "mesh/vertices": self.mesh.vertices,
            "mesh/tets": self.mesh.tets,
            "embedding/cells": self.embedding.cells,
            "embedding/weights": self.embedding.weights,
            **{f"attachments/{bone}": ids for bone, ids in self.attachments.items()},
            **{f"landmarks/{label}": vertex for label, vertex in self.landmarks.items()},
        }

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> SoftBody:
        """What `to_group` gave, as an artifact returned it."""
        return SoftBody(
            Surface(group["vertices"], group["triangles"]),
            TetMesh(group["mesh"]["vertices"], group["mesh"]["tets"]),
            Embedding(group["embedding"]["cells"], group["embedding"]["weights"]),
            dict(group["attachments"]),
            np.asarray(group["visible"], dtype=bool),
            {label: int(vertex) for label, vertex in group.get("landmarks", {}).items()},
        )
