"""The tissue with creases in a frame: bent in steps from neutral, or from another frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from handpipe.core import Array, Frame, Shapes
from handpipe.fem.solver import Settled
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.fat.bending import Origin, Pace
from handpipe.tissues.fat.creases.fold_form import fold_form
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.tissue import Tissue

PACE = Pace(step=np.radians(10.0), iterations=3)  # its skin is no stiffer than the rest


class CreaseLayer(TissueLayer):
    """The single soft tissue with creases.

    A fold that a blend of bones makes ends tangled. Bent in steps, sheets of skin meet one another at the
    barrier and never cross.

    Parameters
    ----------
    name : str
        "skin".
    tissue : Tissue
        A tissue with creases.
    strains : FatStrains, optional
        As of `TissueLayer`.
    strict : bool
        As of `TissueLayer`.

    References
    ----------
    Wang 2019 §5.
    """

    pace = PACE

    def at_rest(
        self,
        frame: Frame,
        below: Mapping[str, Shapes],
        starts: Sequence[Array],
        origin: Origin | None = None,
    ) -> Settled:
        """The equilibrium in a frame, bent from another pose; it does not depend on the starts (n, 3).

        Raises
        ------
        ConvergenceError
            Where a step fails, however small.
        """
        if not self.bends:
            return super().at_rest(frame, below, starts)
        return self.bent(origin or Origin.neutral(self.tissue, below), frame, below)

    def shapes_at(self, settled: Settled, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As of `TissueLayer`; the skin's figures tell, too, how deep (mm) and sharp (deg) it folds."""
        shapes, creases = super().shapes_at(settled, frame, below), self.tissue.creases
        if creases is None:
            return shapes
        skin, neutral = shapes["skin"], self.tissue.skin
        folds = fold_form(neutral, neutral.moved(skin.vertices), creases.folding)
        return shapes | {"skin": replace(skin, figures=skin.figures | folds)}


def load_skin(files: Sequence[Path], _: Mapping[str, Surface]) -> TissueLayer:
    """One soft tissue around the bones, with creases where its artifact has them.

    Parameters
    ----------
    files : sequence of path
        The artifact of its mesh.
    _ : mapping of str to Surface
        Not used.

    Returns
    -------
    TissueLayer
        The layer "skin".

    References
    ----------
    Zheng 2022 Table 4, model m2; Wang 2019.
    """
    [mesh] = files
    tissue = Tissue.load(mesh)
    layer = TissueLayer if tissue.creases is None else CreaseLayer
    return layer("skin", tissue)
