"""Points that slide on a surface: held to it both ways, free along it."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.fem.contact.constraints import SurfaceContact, dyads


class SurfaceSliding(SurfaceContact):
    """Springs k/2 d^2 on the signed distance d in mm of points to a surface.

    As for `SurfaceContact` the closest places follow the points, and the Hessian is exact: stiff in all
    directions where a vertex is closest, across an edge, and along the normal of a face. Zheng 2022 §6 holds
    a point to a plane instead, which must be taken anew whenever the point has slid.
    """

    one_sided = False
    far = np.inf  # no point is free

    def energies(self, points: Array) -> Array:
        """Energy (k,) in microjoules of each point's distance from the surface."""
        return 0.5 * self.stiffness * self._query(points)[0] ** 2

    def forces(self, points: Array) -> Array:
        """Gradient (k, 3) in mN of each point's energy, along the gradient of the distance."""
        signed, normals, _ = self._query(points)
        return (self.stiffness * signed)[:, None] * normals

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (k, 3, 3) in mN/mm: exact and semidefinite, with or without `project`."""
        _, normals, shapes = self._query(points)
        return self.stiffness[:, None, None] * (dyads(normals) + shapes)
