"""The strains of all tets as unknowns (Wang 2021 §5.4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, IntArray
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Potential
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.rigid_motions import LooseMotions
from handpipe.shapes.optimisation.gauss_newton import RIDGE, GaussNewton, MarkRows
from handpipe.shapes.optimisation.response import Response
from handpipe.shapes.optimisation.settings import SearchSettings
from handpipe.shapes.optimisation.strain_space import Stage, State, Step
from handpipe.shapes.strains.smoothness import Smoothness
from handpipe.shapes.strains.strain_frame import StrainFrame


class AllTets:
    """Log-strains (m, 6) of tets (m, 4), with smoothness |L S|^2.

    frame: of the log-strains, where the mesh at rest is not the template.
    """

    def __init__(self, tets: IntArray, settings: SearchSettings, frame: StrainFrame | None = None) -> None:
        """Raises `InputError` where tets (m, 4) are not connected by faces, or fewer than two."""
        self.smoothness, self.settings, self.frame = Smoothness(tets), settings, frame
        self._count = len(tets)

    def zero(self) -> Array:
        """No strain (m, 6)."""
        return np.zeros((self._count, 6))

    def logs(self, unknowns: Array) -> Array:
        """The unknowns themselves."""
        return unknowns

    def plastic(self, unknowns: Array) -> Array:
        """Plastic strains (m, 6) from the rest shape on."""
        return plasticity.exp(unknowns if self.frame is None else self.frame(unknowns))

    def prior(self, unknowns: Array) -> float:
        """|L S|^2, and a tiny weight on means, which L does not see."""
        return 2.0 * self.smoothness.energy(unknowns) + float(RIDGE @ unknowns.mean(axis=0) ** 2)

    def step(self, state: State, external: Sequence[Potential], marks: Correspondence, stage: Stage) -> Step:
        """Over uniform strains (`fields` is 1) or all."""
        system = self.system(state, external, marks, stage.weight)
        return system.uniform() if stage.fields == 1 else system.solve()

    def system(
        self, state: State, external: Sequence[Potential], marks: Correspondence, weight: float
    ) -> GaussNewton:
        """The quadratic model of the objective about a state."""
        loose = LooseMotions(state.attachments.targets, state.x).modes(state.x)
        response = Response(state.body, external, state.x, state.unknowns, loose, self.frame)
        return GaussNewton(self.smoothness, response, self.rows(state, marks, weight), state.unknowns)

    def rows(self, state: State, marks: Correspondence, weight: float) -> MarkRows:
        """Weighted residuals of marks and attachments."""
        matrix, residuals = marks.rows(state.x)
        of_marks, of_attachments = np.sqrt(weight), np.sqrt(self.settings.beta)
        return MarkRows(
            sp.vstack([of_marks * matrix, of_attachments * state.attachments.wide], format="csr"),
            np.concatenate(
                [of_marks * residuals, of_attachments * state.attachments.errors(state.x).ravel()]
            ),
        )
