"""The flesh: one soft tissue on bones alone, which carries the organs in it before any is simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from handpipe.core import LAYERS, Array, Frame, Shape, Shapes, SimulatedFrame, vertices_of
from handpipe.fem.potentials import Viscous
from handpipe.fem.solver import Limits
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.fat.resting import LoadCase, settled_from
from handpipe.tissues.fat.tissue import Tissue, TissueSettings

SKIN_STIFFER = TissueSettings().skin_young / TissueSettings().young  # times as stiff as what lies under it
# mm: the places of organs within are needed to a tenth of a millimetre, and the skin is not needed.
BRIEFLY = Limits(renewals=3, settled=0.05, gross=np.inf)


class FleshLayer(Viscous):
    """How soft tissue moves with the bones, in seconds: one tissue in its skin, which passes through itself.

    It is an aid of other layers, not an organ: nothing shows it.
    """

    name = "flesh"
    needs = LAYERS[name].needs

    def __init__(self, tissue: Tissue) -> None:
        settings = replace(tissue.settings, skin_young=SKIN_STIFFER * tissue.settings.young)
        self.tissue = replace(tissue, settings=settings, skin_contact=False)

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The tissue's tets at equilibrium, from the blend of the bones.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium, or tets are inverted.
        """
        return self._near(self.tissue.pose(frame.bones), frame, below)

    def solve_after(self, before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The tissue's tets at equilibrium, from those of another frame as the bones carry them.

        Viscous tissue resists its way from that frame.

        Raises
        ------
        ConvergenceError
            As `solve`.
        """
        x = before[1][self.name]["flesh_mesh"].vertices
        start = self.tissue.after(self.name, before, frame.bones)
        return self.moving_from(x, self.tissue.elastic)._near(start, frame, below)

    def _near(self, start: Array, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The tissue's tets at equilibrium near a start (n, 3)."""
        tissue, bones = self.tissue, frame.bones
        rigid = {name: bones[part.bone] for name, part in tissue.rigid.items()}
        case = replace(LoadCase.of(tissue, below, rigid), viscosity=self.viscosity)
        settled = settled_from(case, start, BRIEFLY)
        rest, validity = tissue.mesh.vertices, tissue.validity(settled.x)
        validity.require(f"flesh of {frame.name}", vertices_of(below.get("bones", {})))
        figures = settled.figures | settled.validity | validity.figures
        return {"flesh_mesh": Shape(rest, settled.x, tissue.mesh.tets, figures=figures)}


def load(files: Sequence[Path], _: Mapping[str, Surface]) -> FleshLayer:
    """The layer of an artifact."""
    [file] = files
    return FleshLayer(Tissue.load(file))
