"""Points that slide on a surface: springs resist distance to either side, not motion along it."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.fem.contact.points import dyads
from handpipe.fem.contact.surface_contact import SurfaceContact


class SurfaceSliding(SurfaceContact):
    """Sliding constraint: springs s/2 d^2 on the signed distance d of points from a surface.

    As for `SurfaceContact` the closest places follow the points, and the Hessian is exact: stiff in all
    directions where a vertex is closest, across an edge, and along the normal of a face. Zheng 2022 §6 uses
    planes instead, which must be updated whenever a point has slid.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        Takes vertex positions (n, 3) to points (k, 3).
    distance : Distance
        Signed distances to the closed surface in mm, negative inside.
    stiffness : float or array (k,)
        Stiffness s in mN/mm, zero or more.
    thickness : float
        Signed distance in mm from which the free distance of a Newton step is measured; it does not enter the
        energy.
    onset : float
        Not used.
    reach : float
        Length in mm by which a point may move, beyond its free distance, within one Newton step.

    Raises
    ------
    InputError
        If a stiffness is misshapen, negative or not finite.

    References
    ----------
    Zheng 2022 §6.
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
