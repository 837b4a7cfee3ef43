"""The ligaments as a layer: muscles that touch nothing, each solved alone (000 section 4)."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping

from handpipe.errors import ConvergenceError
from handpipe.fem.materials import Material
from handpipe.layers import Frame, Shapes
from handpipe.muscles.layer import MuscleLayer, SimulationOptions
from handpipe.muscles.muscle import Muscle

log = logging.getLogger(__name__)

LIGAMENT = Material(200.0, 0.48)  # kPa; at 0.45 a clenched fist turns tets at their ends inside out

# mN/mm of an attached point, one after the other: where the ends come so near to one another that a tet has
# corners of both, the stiffest turn it inside out. The softest leave an end 0.5 mm off in a fist.
SPRINGS = (20000.0, 5000.0, 2000.0)


class LigamentLayer:
    """Ligaments of loaded artifacts. Their own stiffness does not matter between stiff attachments, its
    evenness does.
    """

    name = "ligaments"
    needs: tuple[str, ...] = ("bones",)

    def __init__(self, ligaments: Iterable[Muscle]) -> None:
        options = SimulationOptions(material=LIGAMENT, bed=0.0)
        self._alone = [MuscleLayer([ligament], options, contact=False) for ligament in ligaments]

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `MuscleLayer.solve`: each ligament's surface, and its tetrahedra under `{ligament}_mesh`."""
        shapes: Shapes = {}
        for layer in self._alone:
            shapes |= _solved(layer, frame, below)
        return shapes


def _solved(layer: MuscleLayer, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
    """On the stiffest of `SPRINGS` with which no tet is inside out; `ConvergenceError` without one."""
    *stiffer, last = SPRINGS
    for spring in stiffer:
        try:
            return layer.on_springs(spring).solve(frame, below)
        except ConvergenceError as error:
            log.warning("%s: %s Going on with softer attachments.", frame.name, error)
    return layer.on_springs(last).solve(frame, below)
