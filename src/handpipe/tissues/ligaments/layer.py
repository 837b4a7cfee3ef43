"""The ligaments as a layer: stiff muscles whose bed is the capsules of the joints (Zheng 2022 §4.1)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from handpipe.core import LAYERS
from handpipe.fem.elements import Material
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.muscles import Muscle, MuscleLayer, SimulationOptions

LIGAMENT = Material(200.0, 0.48)  # kPa
SPRING = 20000.0  # mN/mm of an attached point
CAPSULE = 50.0  # mN/mm of 1 mm^2 of surface: the joint's capsule, without which a slack ligament folds
CONTACT = 5000.0  # mN/mm of a point in contact: as stiff beside a ligament as muscles' contact beside them


class LigamentLayer(MuscleLayer):
    """Ligaments of loaded artifacts.

    Blends of the motions of a ligament's bones say where its joint's capsule takes it. With stiff attachments
    the absolute stiffness of ligaments hardly matters; its uniformity does.
    """

    name = "ligaments"
    needs = LAYERS[name].needs

    def __init__(self, ligaments: Iterable[Muscle]) -> None:
        options = SimulationOptions(material=LIGAMENT, spring=SPRING, bed=CAPSULE, contact=CONTACT)
        super().__init__(ligaments, options)

    def behind_barrier(self) -> LigamentLayer:
        """The same layer: the barrier is the muscles' alone."""
        return self


def load(files: Sequence[Path], _: Mapping[str, Surface]) -> LigamentLayer:
    """The layer of artifacts, one a ligament."""
    return LigamentLayer(map(Muscle.load, files))
