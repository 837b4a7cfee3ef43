"""The bodies that hold a tissue, on their way from one pose to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, RigidTransform, Shape, Shapes
from handpipe.skeleton.posing import blend, blended
from handpipe.tissues.fat.tissue import Tissue

CORNERS = 4  # vertices of the tissue from which a body's vertex has its weights of bones


@dataclass(frozen=True)
class _Soft:
    """A body that is no bone: weights (v, n_bones), and its shifts (v, 3) in mm at both ends of the way."""

    shape: Shape
    weights: Array
    first: Array
    last: Array


class Bodies:
    """The bodies of a tissue's inner points between two poses.

    Bones are rigid. Other bodies are blended with the bones, from shifts that go evenly from those of the one
    pose to those of the other: at both ends they are where they are known to be.

    Parameters
    ----------
    tissue : Tissue
        The tissue that they hold.
    origin, bones : mapping of str to RigidTransform
        Transforms of the bones in the first and in the last pose.
    before, below : mapping of str to Shapes
        Shapes by layer in the first and in the last pose.
    """

    def __init__(
        self,
        tissue: Tissue,
        origin: Mapping[str, RigidTransform],
        bones: Mapping[str, RigidTransform],
        before: Mapping[str, Shapes],
        below: Mapping[str, Shapes],
    ) -> None:
        self._tissue, self._bones = tissue, tissue.bones
        self._origin, self._last = origin, bones
        self._before, self._below = before, below
        named = list(zip(tissue.inner.layers, tissue.inner.bodies, strict=True))
        self._rigid = below.get("bones", {})  # also those that fasciae cover: the skin touches them
        self._others = [key for key in named if key[0] != "bones"]

    @cached_property
    def _soft(self) -> dict[tuple[str, str], _Soft]:
        """Bodies that are no bones, by layer and name: a way of one step needs none."""
        tissue, found = self._tissue, dict[tuple[str, str], _Soft]()
        tree = cKDTree(tissue.mesh.vertices)
        for layer, name in self._others:
            shape = self._below[layer][name]
            distances, near = tree.query(shape.rest, k=CORNERS)
            shares = 1.0 / np.maximum(distances, 1e-6)
            shares /= shares.sum(axis=1, keepdims=True)
            weights = np.einsum("vk,vkb->vb", shares, tissue.weights[near])
            first = self._shifts(self._before[layer][name], weights, self._origin)
            found[layer, name] = _Soft(shape, weights, first, self._shifts(shape, weights, self._last))
        return found

    def _shifts(self, shape: Shape, weights: Array, bones: Mapping[str, RigidTransform]) -> Array:
        """Shifts (v, 3) in mm of a body at rest with which the blend of the bones gives its shape."""
        turns, translation = blended(weights, {b: bones[b] for b in self._bones})
        shifts: Array = turns.inv().apply(shape.vertices - translation) - shape.rest
        return shifts

    def at(self, bones: Mapping[str, RigidTransform], share: float) -> dict[str, Shapes]:
        """Shapes by layer with the bones at a share of their way."""
        found: dict[str, Shapes] = {
            "bones": {name: replace(s, vertices=bones[name](s.rest)) for name, s in self._rigid.items()}
        }
        own = {b: bones[b] for b in self._bones}
        for (layer, name), body in self._soft.items():
            rest = body.shape.rest + (1.0 - share) * body.first + share * body.last
            moved = replace(body.shape, vertices=blend(rest, body.weights, own))
            found[layer] = {**found.get(layer, {}), name: moved}
        return found
