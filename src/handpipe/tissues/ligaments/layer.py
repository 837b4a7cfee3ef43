"""The ligaments as a layer: muscles that touch nothing, each solved alone (Zheng 2022 §4)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from handpipe.core import LAYERS, Array, Frame, RigidTransform, Shapes, SimulatedFrame
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.muscles import Muscle, MuscleLayer, SimulationOptions

LIGAMENT = Material(200.0, 0.48)  # kPa

SPRING = 20000.0  # mN/mm of an attached point


class LigamentLayer:
    """Ligaments of loaded artifacts.

    With stiff attachments the absolute stiffness of ligaments hardly matters; its uniformity does.
    """

    name = "ligaments"
    needs = LAYERS[name].needs

    def __init__(self, ligaments: Iterable[Muscle]) -> None:
        options = SimulationOptions(material=LIGAMENT, bed=0.0, spring=SPRING)
        self._alone = [MuscleLayer([ligament], options, contact=False) for ligament in ligaments]

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `MuscleLayer.solve`: each ligament's surface, and its tetrahedra under `{ligament}_mesh`."""
        shapes: Shapes = {}
        for layer in self._alone:
            shapes |= layer.solve(frame, below)
        return shapes

    def solve_after(self, before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `solve`, each ligament near where it is in another frame."""
        then, known = before
        alone = then, {**known, MuscleLayer.name: known[self.name]}
        shapes: Shapes = {}
        for layer in self._alone:
            shapes |= layer.solve_after(alone, frame, below)
        return shapes

    def elastic_bodies(self, bones: Mapping[str, RigidTransform]) -> dict[str, Elastic]:
        """The potential of each ligament's tets in a pose, by the name of their shape."""
        return {name: body for layer in self._alone for name, body in layer.elastic_bodies(bones).items()}

    def contact_pressures(self, frame: Frame, shapes: Mapping[str, Shapes]) -> dict[str, dict[str, Array]]:
        """Nothing: ligaments touch nothing."""
        return {}


def load(files: Sequence[Path], _: Mapping[str, Surface]) -> LigamentLayer:
    """The layer of artifacts, one a ligament."""
    return LigamentLayer(map(Muscle.load, files))
