"""The ligaments as a layer: muscles that touch nothing, each solved alone (000 section 4)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from handpipe.fem.materials import Material
from handpipe.layers import Frame, Shapes
from handpipe.muscles.layer import MuscleLayer, SimulationOptions
from handpipe.muscles.muscle import Muscle

LIGAMENT = Material(200.0, 0.48)  # kPa; at 0.45 a clenched fist turns tets at their ends inside out


class LigamentLayer:
    """Ligaments of loaded artifacts. Their own stiffness does not matter between stiff attachments, its
    evenness does.
    """

    name = "ligaments"
    needs: tuple[str, ...] = ("bones",)

    def __init__(self, ligaments: Iterable[Muscle], options: SimulationOptions | None = None) -> None:
        options = options or SimulationOptions(material=LIGAMENT, spring=20000.0)
        self._alone = [MuscleLayer([ligament], options, contact=False) for ligament in ligaments]

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `MuscleLayer.solve`: each ligament's surface, and its tetrahedra under `{ligament}_mesh`."""
        shapes: Shapes = {}
        for layer in self._alone:
            shapes |= layer.solve(frame, below)
        return shapes
