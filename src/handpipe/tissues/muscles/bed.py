"""The bed of a muscle: the flesh around it, which takes it along with the bones.

Muscles that only neighbours keep in place are slender columns: one whose strains are wrong by a hundredth
bends aside by millimetres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handpipe.core import Array, RigidTransform, Shape
from handpipe.mesh.tets import Embedding, TetMesh


@dataclass(frozen=True)
class Bed:
    """Where a muscle's n mesh vertices lie in the flesh's tets.

    Parameters
    ----------
    embedding : Embedding
        Places of the vertices in the flesh's tets.
    beside : array (N, n, 3)
        Offsets in mm from there to the vertices in the N examples, neutral first, as directions of one bone
        of the muscle: they turn with it.
    """

    embedding: Embedding
    beside: Array

    @staticmethod
    def fit(vertices: Array, flesh: Sequence[Shape], motions: Sequence[RigidTransform]) -> Bed:
        """From the mesh vertices (N, n, 3), the flesh and the bone's motions in the examples."""
        embedding = Embedding.embed(vertices[0], TetMesh(flesh[0].rest, flesh[0].cells))
        known = zip(vertices, flesh, motions, strict=True)
        return Bed(embedding, np.stack([(x - embedding(f.vertices)) @ m.rotation for x, f, m in known]))

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {"cells": self.embedding.cells, "weights": self.embedding.weights, "beside": self.beside}

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> Bed:
        """What `to_group` gave, as an artifact returned it."""
        return Bed(Embedding(group["cells"], group["weights"]), group["beside"])
