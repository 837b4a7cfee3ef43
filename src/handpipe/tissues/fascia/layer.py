"""The two fascia layers of the simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from handpipe.core import LAYERS, Array, Frame, InputError, Shape, Shapes, without_sliding
from handpipe.mesh.surfaces import Surface, same_values
from handpipe.skeleton.posing import blend, bone_weights
from handpipe.tissues.fascia.fascia import Fascia


class FasciaLayer:
    """A fascia over the bodies of one other layer: bones or muscles."""

    def __init__(self, fascia: Fascia, over: str) -> None:
        self.fascia, self.over = fascia, over
        self.name = fascia.name
        self.needs = LAYERS[self.name].needs
        self._weights: tuple[dict[str, Surface], Array] | None = None

    def without_sliding(self) -> FasciaLayer:
        """The same cloth, fixed where it slides."""
        regions = without_sliding(self.fascia.regions)
        return FasciaLayer(replace(self.fascia, regions=regions), self.over)

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The cloth at equilibrium.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium.
        InputError
            Where a body that the fascia was built on is not in the layers below.
        """
        fascia = self.fascia
        bodies = {name: self._body(below, name) for name in fascia.bodies}
        rest = {n: Surface(s.rest, s.cells) for n, s in bodies.items()}
        posed = {n: rest[n].moved(s.vertices) for n, s in bodies.items()}
        bones = {n: Surface(s.rest, s.cells) for n, s in below["bones"].items()}
        start = blend(fascia.surface.vertices, self._bone_weights(bones), {n: frame.bones[n] for n in bones})
        vertices = fascia.solve(rest, posed, start)
        fields = {"region": fascia.regions}
        return {self.name: Shape(fascia.surface.vertices, vertices, fascia.surface.triangles, fields)}

    def _body(self, below: Mapping[str, Shapes], name: str) -> Shape:
        if name not in below.get(self.over, {}):
            problem = f"{name} is missing, but the layer {self.name} was built on it"
            raise InputError("layers", self.over, problem, "Simulate it, or build the layer without it")
        return below[self.over][name]

    def _bone_weights(self, bones: Mapping[str, Surface]) -> Array:
        """Weights (n, n_bones) of neutral bones at the cloth's vertices, kept for the next frame."""
        known = self._weights
        if (
            known is None
            or [*known[0]] != [*bones]
            or not all(same_values(known[0][name].vertices, bone.vertices) for name, bone in bones.items())
        ):
            known = self._weights = dict(bones), bone_weights(self.fascia.surface.vertices, bones)
        return known[1]


def load_bone_fascia(files: Sequence[Path], _: Mapping[str, Surface]) -> FasciaLayer:
    """The layer of an artifact, over the bones."""
    [file] = files
    return FasciaLayer(Fascia.load(file), "bones")


def load_muscle_fascia(files: Sequence[Path], _: Mapping[str, Surface]) -> FasciaLayer:
    """The layer of an artifact, over the muscles."""
    [file] = files
    return FasciaLayer(Fascia.load(file), "muscles")
