"""Point-to-plane distance of the skinned tube to a target surface (Zheng et al. 2022, Eq. 18)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from handpipe.core import Array, IntArray, robust
from handpipe.mesh.surfaces import Distance
from handpipe.tissues.tendons.rods.energies import REACH
from handpipe.tissues.tendons.rods.rod import directions, frames
from handpipe.tissues.tendons.rods.tube import SEGMENTS, Tube

LEAST_SPREAD = 0.25  # mm, of the bulk


@dataclass(frozen=True)
class TendonTarget:
    """An extracted tendon surface, and where it can be trusted.

    Parameters
    ----------
    surface : Distance
        Distance to the tendon's surface, in mm.
    bone_distance : callable, optional
        Signed distances (n,) in mm of points (n, 3) to the bones, positive outside.
    margin : float
        Distance in mm to a bone under which surface points are left out: there the tendon's dark image merges
        with dark cortical bone.
    reach : float
        Distance in mm from the tube beyond which the surface belongs to something else.
    """

    surface: Distance
    bone_distance: Callable[[Array], Array] | None = None
    margin: float = 0.7
    reach: float = 2.0

    def closest(self, points: Array, normals: Array, along: Array) -> tuple[Array, Array, Array]:
        """Closest points (n, 3), their pseudonormals (n, 3) and robust weights (n,) in [0, 1] (Tukey).

        normals, along (n, 3): the tube's own normals, and the rod's tangents: cut ends of either surface,
        whose normals run along the rod, say nothing of its course.
        """
        signed, _, closest, target_normals = self.surface.signed(points)
        believed = (np.abs(signed) < self.reach) & (np.sum(normals * target_normals, axis=1) > 0.5)
        believed &= np.abs(np.sum(along * target_normals, axis=1)) < 0.5
        if self.bone_distance is not None:
            believed &= self.bone_distance(closest) > self.margin
        if not believed.any():
            return closest, target_normals, np.zeros(len(points))
        offset = np.sum((points - closest) * target_normals, axis=1)
        centre = np.median(offset[believed])
        spread = max(robust.NORMAL * float(np.median(np.abs(offset[believed] - centre))), LEAST_SPREAD)
        weights = np.maximum(1.0 - ((offset - centre) / (robust.TUKEY * spread)) ** 2, 0.0) ** 2
        return closest, target_normals, np.where(believed, weights, 0.0)


@dataclass
class SurfaceFit:
    """stiffness * sum of squared point-to-plane distances of the tube's vertices, divided by their density.

    The density (vertices per mm of rod) makes `stiffness` (force per mm of offset per mm of length)
    independent of the tube's mesh. Between refreshes, targets are fixed and each segment's frame turns with
    its segment by the smallest rotation; a refresh carries the frames along the rod from `first_normal`
    again.
    """

    tube: Tube
    target: TendonTarget
    first_normal: Array
    stiffness: float
    length: float  # of one segment in mm
    twist: Array | None = None
    closest: Array = field(init=False)
    normals: Array = field(init=False)
    weights: Array = field(init=False)
    _frames: Array = field(init=False)

    def refresh(self, x: Array) -> None:
        """Renew frames, closest points, their normals and the robust weights at x (n, 3) in mm."""
        self._frames = frames(x, self.first_normal, self.twist)
        v = self.tube.skin(x, self._frames)
        surface_normals = _vertex_normals(v, self.tube.triangles)
        self.closest, self.normals, weights = self.target.closest(
            v, surface_normals, self._frames[self.tube.first + 1, :, 0]
        )
        density = len(v) / ((len(x) - 1) * self.length)
        self.weights = self.stiffness / density * weights

    def _turned(self, x: Array) -> Array:
        return smallest_rotations(self._frames[:, :, 0], directions(x)) @ self._frames

    def _residual(self, x: Array) -> Array:
        return np.sum(self.normals * (self.tube.skin(x, self._turned(x)) - self.closest), axis=1)

    def value(self, x: Array) -> float:
        """Energy of vertices x (n, 3) in mm, against the closest points of the last refresh."""
        return float(self.weights @ self._residual(x) ** 2)

    def _rows(self, x: Array) -> Array:
        """Derivative (n, 4, 3) of the residuals by vertices first .. first + 3; exact at the refreshed x."""
        tube, n = self.tube, self.normals[:, None]
        turned = self._turned(x)[tube.carriers]
        d = turned[..., 0]
        r = np.einsum("nsij,nsj->nsi", turned, tube.local)
        # a segment turned by d x delta moves r by delta (d . r) - d (delta . r)
        turn = np.sum(d * r, axis=2)[..., None] * n - np.sum(n * d, axis=2)[..., None] * r
        turn -= np.sum(turn * d, axis=2)[..., None] * d
        edge = np.linalg.norm(np.diff(x, axis=0), axis=1)[tube.carriers][..., None]
        rows = np.zeros((len(n), SEGMENTS + 1, 3))
        w = tube.weights[..., None]
        rows[:, :-1] += w * (0.5 * n - turn / edge)
        rows[:, 1:] += w * (0.5 * n + turn / edge)
        return rows

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) of the energy; exact at the x of the last refresh."""
        g = np.zeros_like(x)
        rows = (2.0 * self.weights * self._residual(x))[:, None, None] * self._rows(x)
        for a in range(SEGMENTS + 1):
            np.add.at(g, self.tube.first + a, rows[:, a])
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        """Gauss-Newton: the residuals' own curvature is left out."""
        used = self.weights > 0
        rows, first = self._rows(x)[used], self.tube.first[used]
        left = 2.0 * self.weights[used, None, None] * rows
        for a in range(SEGMENTS + 1):
            for k in range(min(REACH, SEGMENTS - a) + 1):
                np.add.at(blocks[:, k], first + a, left[:, a, :, None] * rows[:, a + k, None, :])


def smallest_rotations(a: Array, b: Array) -> Array:
    """Rotations (n, 3, 3) of unit vectors a (n, 3) onto b (n, 3), not opposite, about their cross product."""
    v = np.cross(a, b)
    skew = np.zeros((len(a), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    skew -= np.swapaxes(skew, 1, 2)
    share = 1.0 / np.maximum(1.0 + np.sum(a * b, axis=1), 1e-9)
    return np.eye(3) + skew + share[:, None, None] * (skew @ skew)


def _vertex_normals(vertices: Array, triangles: IntArray) -> Array:
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for i in range(3):
        np.add.at(normals, triangles[:, i], area)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
