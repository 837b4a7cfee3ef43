"""Contact of one bone's articular surface with another bone through cartilage: an elastic foundation.

Each point of the moving bone's surface carries a column of cartilage of both bones, as if its neighbours were
not there (Blankevoort et al. 1991). The column is compressed where the bones are closer than its thickness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import ndimage

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.acquisition import image

Surface = tuple[Array, IntArray]

WIDTH = 3.0  # mm from a surface within which its distance is sampled; beyond, nothing touches it
GRID = 0.5  # mm, spacing of the samples of a bone's signed distance


@dataclass(frozen=True)
class DistanceField:
    """Signed distance to a bone as a cubic spline, twice differentiable.

    Parameters
    ----------
    coefficients : array (nx, ny, nz)
        Coefficients of cubic B-splines in mm.
    grid : VoxelGrid
        Where they are.
    """

    coefficients: Array
    grid: image.VoxelGrid

    @staticmethod
    def around(surface: Surface, centre: Array, radius: float) -> DistanceField:
        """Of a closed surface, within a ball (mm) about a point (3,)."""
        corners = np.array([centre - radius, centre + radius])
        grid = image.VoxelGrid.around(corners, 2 * GRID, GRID)
        values = image.signed_distance(surface, grid, WIDTH)
        return DistanceField(ndimage.spline_filter(values, mode="mirror"), grid)

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Distances (n,) in mm at points (n, 3) and their gradients (n, 3); beyond the ball, far away."""
        distance, gradient = _spline(self.coefficients, self.grid.indices(points))
        return distance, gradient / self.grid.spacing


@njit(cache=True)
def _spline(coefficients: Array, index: Array) -> tuple[Array, Array]:
    """Values (n,) and derivatives (n, 3) of a cubic spline at indices (n, 3); infinite, 0 off its grid."""
    values, slopes = np.full(len(index), np.inf), np.zeros((len(index), 3))
    weight, rate = np.empty((3, 4)), np.empty((3, 4))
    for n in range(len(index)):
        first = np.floor(index[n]).astype(np.int64) - 1
        inside = True
        for d in range(3):
            if first[d] < 0 or first[d] + 4 > coefficients.shape[d]:
                inside = False
        if not inside:
            continue
        for d in range(3):
            t = index[n, d] - np.floor(index[n, d])
            weight[d, 0], rate[d, 0] = (1 - t) ** 3 / 6, -((1 - t) ** 2) / 2
            weight[d, 1], rate[d, 1] = (3 * t**3 - 6 * t**2 + 4) / 6, (3 * t**2 - 4 * t) / 2
            weight[d, 2], rate[d, 2] = (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6, (-3 * t**2 + 2 * t + 1) / 2
            weight[d, 3], rate[d, 3] = t**3 / 6, t**2 / 2
        values[n] = 0.0
        for i in range(4):
            for j in range(4):
                for k in range(4):
                    c = coefficients[first[0] + i, first[1] + j, first[2] + k]
                    values[n] += c * weight[0, i] * weight[1, j] * weight[2, k]
                    slopes[n, 0] += c * rate[0, i] * weight[1, j] * weight[2, k]
                    slopes[n, 1] += c * weight[0, i] * rate[1, j] * weight[2, k]
                    slopes[n, 2] += c * weight[0, i] * weight[1, j] * rate[2, k]
    return values, slopes


@dataclass(frozen=True)
class Cartilage:
    """The layers of both bones together.

    Parameters
    ----------
    thickness : float
        Of both layers where nothing presses, in mm.
    modulus : float
        Young's modulus in kPa.
    poisson : float
        Poisson's ratio.
    """

    thickness: float
    modulus: float
    poisson: float

    @property
    def stiffness(self) -> float:
        """Pressure in kPa for a compression by its whole thickness, without motion sidewards."""
        nu = self.poisson
        return self.modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu))


@dataclass(frozen=True)
class Contact:
    """Points of the moving bone, each with its area, on the field of the bone that stays.

    Parameters
    ----------
    field : DistanceField
        Of the bone that stays.
    points : array (n, 3)
        Points of the moving bone's surface in the neutral frame, mm.
    areas : array (n,)
        Their shares of the surface in mm^2.
    cartilage : Cartilage
        What lies between.
    """

    field: DistanceField
    points: Array
    areas: Array
    cartilage: Cartilage

    @staticmethod
    def between(
        fixed: Surface, moving: Surface, centre: Array, radius: float, cartilage: Cartilage
    ) -> Contact:
        """Of two bones: what of the moving one lies within a ball (mm) about the joint's centre (3,)."""
        near = np.linalg.norm(moving[0] - centre, axis=1) < radius
        areas = Mesh(*moving).triangle_areas()
        shares = np.bincount(moving[1].ravel(), np.repeat(areas / 3, 3), len(moving[0]))
        field = DistanceField.around(fixed, centre, radius + 3.0)
        return Contact(field, moving[0][near], shares[near], cartilage)

    def energy(self, moved: Array) -> tuple[float, Array]:
        """Energy in microjoules of the points where they have come to (n, 3), its gradient (n, 3) in mN."""
        distance, normal = self.field(moved)
        thickness = self.cartilage.thickness
        compression = np.maximum(thickness - distance, 0.0)
        slope = self.cartilage.stiffness / thickness * self.areas
        return float(slope @ compression**2) / 2, -(slope * compression)[:, None] * normal

    def deepest(self, moved: Array) -> float:
        """Greatest compression as a share of the thickness; 1 is bone on bone."""
        thickness = self.cartilage.thickness
        return float(max(thickness - self.field(moved)[0].min(), 0.0) / thickness)
