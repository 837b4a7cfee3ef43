"""A muscle that bulges: its bones carry it, and it keeps its volume across."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import njit
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.fem.linear import factorise
from handpipe.levels.mass_spring.followers import Followers
from handpipe.levels.mass_spring.springs import Springs
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import bone_weights

SLICES = 6  # along the muscle, whose centres make its axis
SLIDE = 0.5  # share of an even shortening along the axis; the rest shortens where the joints are
THINNEST, THICKEST = -0.5, 1.5  # of the neutral radius: a muscle does not bulge beyond
NEWTON, SETTLED = 30, 1e-12  # most iterations for the thickening, and its last change
STIFF = 1e6  # of the largest entry of a matrix: what is given at attached vertices


@dataclass(frozen=True, eq=False)
class Bulge:
    """A muscle in a pose.

    Parameters
    ----------
    vertices : array (v, 3)
        Surface, mm.
    shift : array (v, 3)
        What the bulge adds to the surface that the bones carry, mm.
    stretch : float
        Length of its axis between the attachments over the neutral one.
    thickening : float
        By how much of itself the radius grows in the middle.
    volume_error : float
        Volume over the neutral one, less 1: not zero where the radius would grow or shrink too much.
    """

    vertices: Array
    shift: Array
    stretch: float
    thickening: float
    volume_error: float


@dataclass(frozen=True, eq=False)
class GeometricMuscle:
    """A muscle's surface, what carries it, and how it may bulge.

    Parameters
    ----------
    name : str
        Name of the muscle.
    surface : Surface
        Neutral surface, mm.
    followers : Followers
        Its vertices on the bones that carry it.
    axis : Followers
        Centres (k,) of slices, from one end to the other, on the same bones.
    along : sparse matrix (v, k)
        Place of each vertex on the axis, as weights of the centres.
    profile : array (v,)
        Share of slide and thickening: 0 where the muscle is attached, 1 in the middle.
    """

    name: str
    surface: Surface
    followers: Followers
    axis: Followers
    along: sparse.csr_matrix
    profile: Array

    @staticmethod
    def of(
        name: str,
        surface: Surface,
        attachments: Mapping[str, IntArray],
        bones: Mapping[str, Surface],
        numbers: Mapping[str, int],
    ) -> GeometricMuscle:
        """From a neutral surface and its attachments.

        Parameters
        ----------
        name : str
            Name of the muscle.
        surface : Surface
            Neutral closed surface, mm.
        attachments : mapping of str to array (k,) of int
            Vertices that are attached to each bone; bones without any do not count.
        bones : mapping of str to Surface
            Neutral bones that carry it, mm: those that it is attached to, and those between.
        numbers : mapping of str to int
            Number of each bone among the motions of a frame.

        Returns
        -------
        GeometricMuscle
        """
        own = [ids for ids in attachments.values() if len(ids)]
        x, number = surface.vertices, np.array([numbers[bone] for bone in bones])
        centres, along = _axis(x, _direction(x, own))
        followers, axis = (Followers.of(at, bone_weights(at, bones), number) for at in (x, centres))
        return GeometricMuscle(name, surface, followers, axis, along, _profile(surface, np.concatenate(own)))

    @cached_property
    def volume(self) -> float:
        """Neutral volume in mm^3."""
        return self.surface.volume()

    def posed(self, duals: Array) -> Bulge:
        """The muscle on bones that have moved.

        Bones carry it, it slides along its axis so that it shortens more evenly, and its radius grows by the
        one share at which its volume is that of neutral.

        Parameters
        ----------
        duals : array (b, 8)
            Dual quaternions of all bones.

        Returns
        -------
        Bulge
        """
        carried, axis = self.followers.moved(duals), self.axis.moved(duals)
        before, after = _arclength(self.axis.rest), _arclength(axis)
        stretch = float(after[-1] / before[-1])
        even = np.stack([np.interp(before * stretch, after, c) for c in axis.T], axis=1)
        share = self.profile[:, None]
        slide = SLIDE * share * (self.along @ (even - axis))
        across = share * (carried - self.along @ axis)
        cubic = np.zeros(4)
        volumes(carried + slide, across, self.surface.triangles, cubic)
        cubic[0] -= self.volume
        thickening = _least_root(cubic)
        missing = float(np.polyval(cubic[::-1], thickening)) / self.volume
        shift = slide + thickening * across
        return Bulge(carried + shift, shift, stretch, thickening, missing)


def _laplacian(surface: Surface) -> sparse.csr_matrix:
    """Graph Laplacian of a surface's edges, weighted by their inverse lengths."""
    springs = Springs.of(surface, across=0.0)
    inverse = springs._replace(stiffness=springs.stiffness / np.maximum(springs.lengths, 1e-9))
    return inverse.laplacian(len(surface.vertices))


def _profile(surface: Surface, attached: IntArray) -> Array:
    """0 on attached vertices (k,), 1 at most: the solution of Poisson's equation between."""
    laplacian, count = _laplacian(surface), len(surface.vertices)
    pin = np.zeros(count)
    pin[attached] = STIFF * laplacian.max()
    found = factorise((laplacian + sparse.diags(pin)).tocsr()).solve(np.where(pin > 0, 0.0, 1.0))
    return np.maximum(found, 0.0) / max(float(found.max()), 1e-300)


def _direction(x: Array, attached: Sequence[IntArray]) -> Array:
    """From end to end (3,): the two attachments that are farthest apart; of one, the longest direction."""
    centres = np.array([x[ids].mean(axis=0) for ids in attached])
    apart = centres[:, None] - centres
    first, second = np.unravel_index(np.linalg.norm(apart, axis=2).argmax(), (len(centres),) * 2)
    if first == second:
        return np.asarray(np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2][0])
    return np.asarray(apart[second, first])


def _axis(x: Array, direction: Array) -> tuple[Array, sparse.csr_matrix]:
    """Centres (k, 3) of slices of one breadth, and where each point (v, 3) is between them."""
    t = x @ direction
    breadth = max(float(np.ptp(t)), 1e-300) / SLICES
    _, number = np.unique(np.minimum((t - t.min()) // breadth, SLICES - 1), return_inverse=True)
    count = np.bincount(number)
    middle = np.bincount(number, t) / count
    centres = np.stack([np.bincount(number, c) for c in x.T], axis=1) / count[:, None]
    weights = np.stack([np.interp(t, middle, unit) for unit in np.eye(len(count))], axis=1)
    return centres, sparse.csr_matrix(weights)


def _arclength(points: Array) -> Array:
    """Length (k,) in mm of a polyline up to each point."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _least_root(cubic: Array) -> float:
    """Root near zero of a cubic (4,), lowest power first, within what a muscle may do (Newton's method)."""
    a, b, c, d = (float(value) for value in cubic)
    root = 0.0
    for _ in range(NEWTON):
        slope = b + root * (2 * c + root * 3 * d)
        if slope <= 0:  # thicker makes no more of it
            break
        step = (a + root * (b + root * (c + root * d))) / slope
        root = min(max(root - step, THINNEST), THICKEST)
        if abs(step) < SETTLED:
            break
    return root


@njit(cache=True)
def _triple(a: Any, b: Any, c: Any) -> float:
    """Volume of the parallelepiped of three vectors (3,)."""
    return float(
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


@njit(cache=True)
def volumes(x: Any, across: Any, triangles: Any, out: Any) -> None:
    """Coefficients (4,) of the volume inside x + s across (v, 3) as a polynomial of s, into out."""
    out[:] = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        p, q, r, u, v, w = x[i], x[j], x[k], across[i], across[j], across[k]
        out[0] += _triple(p, q, r) / 6
        out[1] += (_triple(u, q, r) + _triple(p, v, r) + _triple(p, q, w)) / 6
        out[2] += (_triple(p, v, w) + _triple(u, q, w) + _triple(u, v, r)) / 6
        out[3] += _triple(u, v, w) / 6
