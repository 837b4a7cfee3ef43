"""Points that slide on a surface: held to it both ways, free along it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handpipe.fem.constraints import SurfaceContact

Array = NDArray[np.float64]


class SurfaceSliding(SurfaceContact):
    """Springs k/2 d^2 on the signed distance d in mm of points to a surface.

    As for `SurfaceContact` the closest places follow the points, and the Hessian leaves curvature out. 000
    section 6 holds a point to a plane instead, which must be taken anew whenever the point has slid.
    """

    def energies(self, points: Array) -> Array:
        return 0.5 * self.stiffness * self._query(points)[0] ** 2

    def forces(self, points: Array) -> Array:
        signed, normals = self._query(points)
        return (self.stiffness * signed)[:, None] * normals

    def stiffnesses(self, points: Array, project: bool) -> Array:
        normals = self._query(points)[1]
        return self.stiffness[:, None, None] * normals[:, :, None] * normals[:, None, :]
