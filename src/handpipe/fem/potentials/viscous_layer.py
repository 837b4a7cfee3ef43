"""What layers have in common whose tissue resists motion from frame to frame."""

from __future__ import annotations

import copy
from typing import Self

from handpipe.core import Array
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.viscosity import Viscosity


class Viscous:
    """A layer whose tissue may resist motion from frame to frame, in `solve_after` alone."""

    retardation = 0.0  # retardation time of the tissue over the time between two frames
    viscosity: Viscosity | None = None  # over the step from the frame before, while a frame follows it

    def viscous(self, retardation: float) -> Self:
        """The same layer with viscous tissue.

        Parameters
        ----------
        retardation : float
            Retardation time of the tissue over the time between two frames; zero: not viscous.

        Returns
        -------
        Viscous
            The layer.
        """
        other = copy.copy(self)
        other.retardation = retardation
        return other

    def moving_from(self, x: Array, body: Elastic) -> Self:
        """The same layer, its viscosity over the step from x.

        Parameters
        ----------
        x : array (n, 3)
            Positions in mm in the frame before.
        body : Elastic
            Its tissue.

        Returns
        -------
        Viscous
            The layer; itself where it is not viscous.
        """
        if not self.retardation:
            return self
        other = copy.copy(self)
        other.viscosity = Viscosity(body, x, self.retardation)
        return other
