"""Slices of a volume with the contours of surfaces drawn over them (Zheng 2022, Figs. 32, 33)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from handpipe.core import Array
from handpipe.mesh.surfaces import Surface

Sample = Callable[[Array], NDArray]  # points (n, 3) in mm -> values (n,), NaN outside of the volume

STRAIGHT = 2.0  # mm: bones closer to a line than this hardly affect the sagittal plane


@dataclass(frozen=True)
class Plane:
    """A plane with orthonormal axes: its point (s, t) is origin + s right + t up, in mm.

    Parameters
    ----------
    origin : array (3,)
        Point in mm.
    right, up : array (3,)
        Unit vectors, perpendicular to each other.
    """

    origin: Array
    right: Array
    up: Array

    @property
    def normal(self) -> Array:
        """Unit normal (3,): right x up."""
        return np.cross(self.right, self.up)

    def points(self, coordinates: Array) -> Array:
        """Points (..., 3) of plane coordinates (..., 2)."""
        return self.origin + coordinates[..., :1] * self.right + coordinates[..., 1:] * self.up

    def coordinates(self, points: Array) -> Array:
        """Plane coordinates (..., 2) of points (..., 3), projected along the normal."""
        return (points - self.origin) @ np.stack([self.right, self.up], axis=1)


def sagittal_plane(centroids: Array, across: Array, along: Array) -> Plane:
    """The plane through a posed finger's bone centroids.

    A straight finger leaves the plane free to turn about its axis; a bent one fixes the plane by itself.

    Parameters
    ----------
    centroids : array (b, 3)
        Centroids in mm, b >= 2.
    across : array (3,)
        Direction of the normal, as far as the centroids allow.
    along : array (3,)
        Distal direction, which points to the right.

    Returns
    -------
    Plane
        Its origin is the mean of the centroids.
    """
    centre = centroids.mean(axis=0)
    scatter = (centroids - centre).T @ (centroids - centre)
    normal = np.linalg.solve(scatter + STRAIGHT**2 * np.eye(3), np.asarray(across, float))
    return _plane(centre, normal, along)


def transversal_plane(bone: Array, up: Array, place: float = 0.5) -> Plane:
    """The plane perpendicular to a bone's long axis.

    Parameters
    ----------
    bone : array (n, 3)
        Vertices in mm.
    up : array (3,)
        Dorsal direction, which points upwards in the slice as far as the plane allows.
    place : float
        Place of the plane as a fraction of the bone's length.

    Returns
    -------
    Plane
        Its origin is on the long axis.
    """
    centre = bone.mean(axis=0)
    _, _, axes = np.linalg.svd(bone - centre, full_matrices=False)
    axis = axes[0]
    reach = (bone - centre) @ axis
    low, high = float(reach.min()), float(reach.max())
    right = np.cross(np.asarray(up, float), axis)
    return _plane(centre + (low + place * (high - low)) * axis, axis, right)


def _plane(origin: Array, normal: Array, right: Array) -> Plane:
    normal = normal / np.linalg.norm(normal)
    right = np.asarray(right, float) - normal * float(np.dot(normal, right))
    right = right / np.linalg.norm(right)
    return Plane(origin, right, np.cross(normal, right))


def section(surface: Surface, plane: Plane) -> Array:
    """Segments (k, 2, 2) in plane coordinates, mm, where the plane cuts the surface."""
    mesh = trimesh.Trimesh(surface.vertices, surface.triangles, process=False)
    segments = trimesh.intersections.mesh_plane(mesh, plane.normal, plane.origin)
    return plane.coordinates(np.asarray(segments, float).reshape(-1, 2, 3))


@dataclass(frozen=True)
class Contours:
    """Surfaces drawn in one colour under one name, e.g. all muscles.

    Parameters
    ----------
    name : str
        Name in the legend.
    surfaces : sequence of Surface
        Surfaces in mm.
    colour : str or tuple of float
        Colour of matplotlib.
    style : "-" or ":"
        Full or dotted lines.
    """

    name: str
    surfaces: Sequence[Surface]
    colour: str | tuple[float, float, float]
    style: Literal["-", ":"] = "-"


def draw_slice(
    axes: Axes,
    sample: Sample | None,
    plane: Plane,
    contours: Sequence[Contours],
    *,
    spacing: float = 0.25,
    margin: float = 4.0,
    grey: tuple[float, float] | None = None,
) -> Mapping[str, Array]:
    """Draw grey values and contours into matplotlib axes in mm.

    Parameters
    ----------
    axes : Axes
        Axes to be drawn into.
    sample : callable, optional
        Grey values (n,) at points (n, 3) in mm; None leaves them out.
    plane : Plane
        Plane of the slice.
    contours : sequence of Contours
        Surfaces to be cut.
    spacing : float
        Size in mm of a pixel of grey values.
    margin : float
        Space in mm around the contours.
    grey : tuple of float, optional
        Range of grey values, by default the 1st to the 99.5th percentile of the slice.

    Returns
    -------
    mapping of str to array (k, 2, 2)
        Drawn segments in plane coordinates, mm, by name.
    """
    drawn = {c.name: np.concatenate([section(s, plane) for s in c.surfaces]) for c in contours if c.surfaces}
    points = np.concatenate([s.reshape(-1, 2) for s in drawn.values()]) if drawn else np.zeros((0, 2))
    low = points.min(axis=0, initial=np.inf if len(points) else 0.0) - margin
    high = points.max(axis=0, initial=-np.inf if len(points) else 0.0) + margin
    if sample is not None:
        values = sample_plane(sample, plane, low, high, spacing)
        black, white = grey or tuple(np.nanpercentile(values, [1, 99.5]))
        extent = (low[0], high[0], low[1], high[1])
        axes.imshow(values, cmap="gray", vmin=black, vmax=white, origin="lower", extent=extent)
    for c in contours:
        if c.name in drawn:
            lines = LineCollection(list(drawn[c.name]), colors=[c.colour], linewidths=1.1, linestyles=c.style)
            axes.add_collection(lines)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="mm", ylabel="mm")
    return drawn


def sample_plane(sample: Sample, plane: Plane, low: Array, high: Array, spacing: float) -> Array:
    """Values of a volume, rows upwards, between two corners (2,) of a plane; 0 outside of the volume."""
    count = np.maximum(np.ceil((high - low) / spacing).astype(int), 1)
    s, t = (low[i] + (np.arange(count[i]) + 0.5) * (high[i] - low[i]) / count[i] for i in (0, 1))
    grid = np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)
    values = np.asarray(sample(plane.points(grid)), float)
    return np.nan_to_num(values).reshape(count[1], count[0])
