"""Distances between surfaces and between curves, penetration, and overlap of label volumes."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array
from handpipe.mesh.surfaces import Distance, Surface


def surface_distance(points: Array, surface: Surface) -> Array:
    """Unsigned distance of each point to its closest point on a surface.

    With the points of a scanned skin and the simulated skin this is the error of Zheng 2022.

    Parameters
    ----------
    points : array (n, 3)
        Points in mm.
    surface : Surface
        Surface in mm.

    Returns
    -------
    array (n,)
        Distances in mm.

    References
    ----------
    Zheng 2022, Table 4.
    """
    return Distance(surface).closest(points)[0]


def symmetric_distance(a: Surface, b: Surface) -> Array:
    """Distances (n_a + n_b,) in mm of the vertices of a to b, then of b to a.

    The maximum is the Hausdorff distance sampled at vertices.
    """
    return np.concatenate([surface_distance(a.vertices, b), surface_distance(b.vertices, a)])


def penetration(points: Array, closed: Surface) -> Array:
    """Depth (n,) in mm of each point (n, 3) inside a closed surface with outward triangles, 0 outside."""
    return Distance(closed).depths(points)


def curve_distance(points: Array, curve: Array) -> Array:
    """Distance of points to a polyline.

    Parameters
    ----------
    points : array (n, 3)
        Points in mm.
    curve : array (k, 3)
        At least two points of the polyline in mm.

    Returns
    -------
    array (n,)
        Distances in mm.
    """
    segments = np.column_stack([np.arange(len(curve) - 1), np.arange(1, len(curve))])
    squared, _, _ = igl.point_mesh_squared_distance(_float(points), _float(curve), segments)
    return np.sqrt(squared)


def curve_to_curve_distance(a: Array, b: Array) -> Array:
    """Distances (n_a + n_b,) in mm of the points of polyline a to polyline b, then of b to a."""
    return np.concatenate([curve_distance(a, b), curve_distance(b, a)])


def dice(labels: NDArray[np.integer], truth: NDArray[np.integer], label: int) -> float:
    """Dice overlap 2|A∩B| / (|A| + |B|) of one label in two volumes.

    Parameters
    ----------
    labels, truth : array of int
        Labels of two volumes of one shape.
    label : int
        Label that is compared.

    Returns
    -------
    float
        Overlap in 0..1; 1 where both volumes lack the label.
    """
    a, b = labels == label, truth == label
    total = int(a.sum()) + int(b.sum())
    return 2.0 * int((a & b).sum()) / total if total else 1.0


def _float(points: Array) -> Array:
    return np.ascontiguousarray(points, dtype=np.float64)
