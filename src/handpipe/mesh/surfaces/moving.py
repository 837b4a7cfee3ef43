"""Distances to bodies that move from frame to frame, with the trees that can be kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

RIGID = 1e-9  # mm from a rigid motion, within which a body counts as rigid: the rounding of its positions


class RigidDistance(Distance):
    """Distances to a surface that has moved rigidly: queries are moved back to the tree of its rest shape.

    Parameters
    ----------
    rest : Distance
        Distances to the surface at rest.
    surface : Surface
        The surface in its present place.
    motion : RigidTransform
        Transform from rest to that place.
    """

    def __init__(self, rest: Distance, surface: Surface, motion: RigidTransform) -> None:
        self.surface, self.by_winding = surface, rest.by_winding
        self._rest, self._motion, self._back = rest, motion, motion.inverse()

    def closest(self, points: Array) -> tuple[Array, IntArray, Array]:
        """The closest places on the surface, as `Distance.closest`."""
        distances, triangles, closest = self._rest.closest(self._back(_rows(points)))
        return distances, triangles, self._motion(closest)

    def signed(self, points: Array) -> tuple[Array, IntArray, Array, Array]:
        """Signed distances and the closest places with their pseudonormals, as `Distance.signed`."""
        return self._forth(self._rest.signed(self._back(_rows(points))))

    def smooth(self, points: Array) -> tuple[Array, IntArray, Array, Array]:
        """As `signed`, with normals interpolated between those of the vertices."""
        return self._forth(self._rest.smooth(self._back(_rows(points))))

    def ways_out(self, points: Array, directions: Array, most: float) -> tuple[Array, IntArray, Array, Array]:
        """Where points leave the surface in given directions, as `Distance.ways_out`."""
        along = _rows(directions) @ self._motion.rotation
        return self._forth(self._rest.ways_out(self._back(_rows(points)), along, most))

    def depths(self, points: Array) -> Array:
        """Depths (n,) in mm of points (n, 3) inside the surface, which may cut itself; 0 outside."""
        return self._rest.depths(self._back(_rows(points)))

    def _forth(self, found: tuple[Array, IntArray, Array, Array]) -> tuple[Array, IntArray, Array, Array]:
        """Places and normals of the rest shape, moved."""
        distances, triangles, closest, normals = found
        return distances, triangles, self._motion(closest), normals @ self._motion.rotation.T


@dataclass
class _Body:
    """A body's rest shape, the distances to it if they were ever needed, and its last place."""

    rest: Surface
    at_rest: Distance | None = None
    now: Distance | None = None


class BodyDistances:
    """Distances to bodies, frame after frame.

    A body that has moved rigidly from rest keeps the tree, the normals and the sign of its rest shape. Any
    other body has a new tree for each shape, which is kept until its next shape. The distances are those of
    `Distance`, to the rounding of positions.

    Parameters
    ----------
    measure : callable, optional
        From a surface to the distances to it; by default `Distance`.
    """

    def __init__(self, measure: Callable[[Surface], Distance] = Distance) -> None:
        self._measure = measure
        self._bodies: dict[str, _Body] = {}

    def to(self, name: str, rest: Array, surface: Surface) -> Distance:
        """Distances to a body in its present place.

        Parameters
        ----------
        name : str
            Name of the body, its own among all bodies asked for.
        rest : array (n, 3)
            Neutral positions of its vertices in mm.
        surface : Surface
            The body as it is now.

        Returns
        -------
        Distance
        """
        body = self._bodies.get(name)
        if body is None or not (
            same_values(body.rest.vertices, rest) and same_values(body.rest.triangles, surface.triangles)
        ):
            body = self._bodies[name] = _Body(surface.moved(rest))
        if body.now is None or not same_values(body.now.surface.vertices, surface.vertices):
            body.now = self._renewed(body, surface)
        return body.now

    def _renewed(self, body: _Body, surface: Surface) -> Distance:
        motion = rigid_motion(body.rest.vertices, surface.vertices)
        if motion is None:
            return self._measure(body.rest.moved(surface.vertices))
        if body.at_rest is None:
            body.at_rest = self._measure(body.rest)
        return RigidDistance(body.at_rest, surface, motion)


def rigid_motion(rest: Array, vertices: Array) -> RigidTransform | None:
    """The rigid motion from rest (n, 3) to vertices (n, 3) in mm, None where they have deformed."""
    if len(rest) < 3:
        return None
    motion = RigidTransform.fit(rest, vertices)
    return motion if np.abs(motion(rest) - vertices).max() <= RIGID else None


def same_values(a: Array | IntArray, b: Array | IntArray) -> bool:
    """Whether two arrays have the same shape and values; immediate where they share their memory.

    Parameters
    ----------
    a, b : array
        Arrays of any shape.

    Returns
    -------
    bool
    """
    if a.shape == b.shape and a.ctypes.data == b.ctypes.data and a.strides == b.strides:
        return True
    return np.array_equal(a, b)


def _rows(points: Array) -> Array:
    return np.asarray(points, dtype=np.float64).reshape(-1, 3)
