"""The tendons as a layer of the simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from handpipe.core import LAYERS, Frame, Shape, Shapes, flesh_in
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.tendons.rods.rest import PULL
from handpipe.tissues.tendons.tendon import Tendon


class TendonLayer:
    """Tendons of loaded artifacts. Frames do not depend on one another."""

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
        for name, tendon in self.tendons.items():
            found = tendon.solve(frame.bones, flesh)
            surface = tendon.surface(found.x, frame.bones)
            shapes[name] = Shape(self._rest[name], surface.vertices, surface.triangles)
            n = len(found.x)
            segments = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
            figures = {"compression": max(-float(found.tension.min()), 0.0) / PULL}
            shapes[f"{name}_centreline"] = Shape(
                tendon.rest.x, found.x, segments, {"tension": found.tension}, figures
            )
        return shapes


def load(files: Sequence[Path], _: Mapping[str, Surface]) -> TendonLayer:
    """The layer of artifacts, one a tendon."""
    return TendonLayer(map(Tendon.load, files))
