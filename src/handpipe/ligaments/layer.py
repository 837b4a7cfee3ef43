"""Ligaments as a layer of the simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from handpipe.layers import Frame, Shapes
from handpipe.muscles.layer import MuscleLayer
from handpipe.muscles.muscle import Muscle


class LigamentLayer:
    """Ligaments of loaded artifacts: each moves with its bones alone."""

    name = "ligaments"
    needs: tuple[str, ...] = ("bones",)

    def __init__(self, ligaments: Iterable[Muscle]) -> None:
        self._bodies = MuscleLayer(ligaments, contact=False)

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """Each ligament's surface, and its tetrahedra under `{ligament}_mesh`. Raises `ConvergenceError`."""
        return self._bodies.solve(frame, below)
