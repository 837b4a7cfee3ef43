"""The tendons as a layer of the simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe.core import LAYERS, Array, Frame, Shape, Shapes, flesh_in
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.tendons.rods.rest import PULL
from handpipe.tissues.tendons.tendon import Tendon

CENTRELINE = "_centreline"  # ends the name of the body that is a tendon's rod, beside that of its surface


class TendonLayer:
    """Tendons of loaded artifacts. Frames do not depend on one another.

    Parameters
    ----------
    tendons : iterable of Tendon
        The tendons.
    """

    name = "tendons"
    needs = LAYERS[name].needs

    def __init__(self, tendons: Iterable[Tendon]) -> None:
        self.tendons = {t.name: t for t in tendons}
        self._rest = {t.name: t.rest.surface().vertices for t in self.tendons.values()}

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """For each tendon its surface, and its rod under `{tendon}_centreline` with segments as cells.

        The rod's field "tension" (Q,) is in the unit of the pull (mN if that is); its figure "compression" is
        the largest compressive force over the pull. A compressed rod is folded: hooks before and behind a
        joint have passed each other, which no tendon follows. Hooks follow the flesh, if `below` has its
        mesh, or else the bones alone.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium.
        """
        shapes: Shapes = {}
        flesh = flesh_in(below)
        for tendon in self.tendons.values():
            found = tendon.solve(frame.bones, flesh)
            figures = {"compression": max(-float(found.tension.min()), 0.0) / PULL}
            shapes |= self._tube(tendon, found.x, frame, {"tension": found.tension}, figures)
        return shapes

    def along(self, frame: Frame, lines: Mapping[str, Array]) -> Shapes:
        """The shapes of `solve` with each rod laid along a given line (n, 3) from its insertion."""
        shapes: Shapes = {}
        for name, tendon in self.tendons.items():
            shapes |= self._tube(tendon, tendon.along(lines[name], frame.bones), frame)
        return shapes

    def without_corrections(self) -> TendonLayer:
        """The same tendons, whose hooks follow bones and flesh alone."""
        return TendonLayer(t.without_corrections() for t in self.tendons.values())

    def by_inverse_distance(self) -> TendonLayer:
        """The same tendons, hooks' corrections interpolated by the weights of Zheng 2022 Eq. 1."""
        return TendonLayer(t.by_inverse_distance() for t in self.tendons.values())

    def _tube(
        self,
        tendon: Tendon,
        x: Array,
        frame: Frame,
        fields: dict[str, NDArray] | None = None,
        figures: dict[str, float] | None = None,
    ) -> Shapes:
        """Surface and centreline of a rod x (Q+1, 3); fields and figures are the centreline's."""
        surface = tendon.surface(x, frame.bones)
        segments = np.stack([np.arange(len(x) - 1), np.arange(1, len(x))], axis=1)
        return {
            tendon.name: Shape(self._rest[tendon.name], surface.vertices, surface.triangles),
            f"{tendon.name}{CENTRELINE}": Shape(tendon.rest.x, x, segments, fields or {}, figures or {}),
        }


def load(files: Sequence[Path], _: Mapping[str, Surface]) -> TendonLayer:
    """The layer of artifacts, one a tendon."""
    return TendonLayer(map(Tendon.load, files))
