"""Log-strains kept in the frame of the template while tets are at rest in another shape.

A tet at rest in a later shape has undergone a rotation R and log-strains C from the template. Of the total
log-strains T, in the template's frame, R (T - C) R^T is the part from the later shape. T stays smooth where
tets are replaced, and smoothness acts on T: the template remains the reference. Logarithms of strains that do
not commute do not add up exactly; smoothness acts on T, mechanics on the strains from the rest shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array
from handpipe.fem.elements import plasticity

UNITS = plasticity.to_matrices(np.eye(6))


@dataclass(frozen=True, eq=False)
class StrainFrame:
    """Rotations R (m, 3, 3) and log-strains C (m, 6) of tets from the template to their rest shape."""

    rotations: Array
    before: Array

    @staticmethod
    def align(rotations: Array, total: Array, since: Array) -> StrainFrame:
        """The frame in which log-strains `total` (m, 6) are `since` (m, 6) from the rest shape on."""
        back = rotations.swapaxes(1, 2) @ plasticity.to_matrices(since) @ rotations
        return StrainFrame(rotations, total - plasticity.from_matrices(back))

    def __call__(self, total: Array) -> Array:
        """Log-strains (m, 6) from the rest shape on."""
        inner = plasticity.to_matrices(total - self.before)
        return plasticity.from_matrices(self.rotations @ inner @ self.rotations.swapaxes(1, 2))

    def operator(self) -> Array:
        """The derivative (m, 6, 6) of that by `total`."""
        turned = self.rotations[:, None] @ UNITS @ self.rotations.swapaxes(1, 2)[:, None]
        columns = plasticity.from_matrices(turned.reshape(-1, 3, 3)).reshape(-1, 6, 6)
        return np.ascontiguousarray(columns.swapaxes(1, 2))
