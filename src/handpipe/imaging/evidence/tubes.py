"""Dark tubes, as tendons are in the image: their course, their centres and their surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy import ndimage
from scipy.interpolate import make_splprep
from skimage.graph import route_through_array

from handpipe.core import Array, InputError
from handpipe.imaging.evidence.profiles import smooth_field
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Distance, Surface

RAYS = 24  # around a section
STEP = 0.1  # mm along a ray
CONTRAST = 0.2  # least rise at the tube's edge, as a part of the bright tissue's level
DARK = 0.4  # of that level: what is as bright is no tendon, but muscle
STIFFNESS = 1.0  # of a tube's smooth radius against a measurement of full confidence
SMOOTHING = 0.7  # voxels, under the cheapest path
FREE = 0.02  # cost of a voxel without signal, over that of a bright one
BRIGHT = 95  # percentile of a neighbourhood: bright tissue
BEYOND = 1.2  # mm of a ray beyond the diameter
CLEAR = 0.2  # mm off a bone: nearer, a ray is hidden
EDGE_WIDTH = 0.3  # mm beyond an edge where its own blur ends
AHEAD = 0.8  # mm behind a rise in which its top is looked for
OFF, SPREAD = 0.6, 0.3  # of the radius: from where, and how fast, an edge loses confidence
PRIOR = (0.05, 0.01)  # weights of a circle's known centre, times its radius squared, and of its radius
SMALLEST = 0.01  # mm^2, of a radius squared
OUTLIER = 0.2  # of the radius, off a circle
UNSEEN = 0.02  # weight of the known radius where no edge is seen
UNLIKE = 0.4  # of the radius, off the neighbours' edges
RANGE = (0.3, 2.0)  # of the radius: distances of the surface
FACING = 0.3  # least cosine by which a ray leaves a bone
THINNEST = 0.1  # mm
FINER = 20  # points of a spline for each that is given


@dataclass(frozen=True)
class Sections:
    """Circular sections of a tube.

    Parameters
    ----------
    centres : array (n, 3)
        Centres in world mm.
    radii : array (n,)
        Radii in mm.
    confidence : array (n,)
        Share of each section's edge that the image shows.
    """

    centres: Array
    radii: Array
    confidence: Array


def trace(volume: Volume, points: Array, margin: float = 6.0) -> Array:
    """Course of a dark structure through clicked points.

    The path of least summed brightness between successive points, smoothed by a spline.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    points : array (k, 3)
        Clicked points in order, in world mm.
    margin : float
        Distance in mm from the points' box within which the path stays.

    Returns
    -------
    array (m, 3)
        Points of the course in world mm, about 0.5 mm apart.

    Raises
    ------
    InputError
        If a point lies outside the volume.
    """
    index = volume.to_index(points)
    if (index < -0.5).any() or (index > np.array(volume.shape) - 0.5).any():
        raise InputError(
            "curve", "points", "some lie outside the volume", "Check the curve's coordinate system"
        )
    reach = np.ceil(margin / volume.spacing).astype(int)
    lower = np.maximum(np.floor(index.min(0)).astype(int) - reach, 0)
    local = volume.crop(lower, np.ceil(index.max(0)).astype(int) + reach + 1)
    smooth = ndimage.gaussian_filter(local.values, SMOOTHING)
    cost = FREE + (smooth / np.percentile(smooth, BRIGHT)) ** 2
    stops = np.clip(np.round(index).astype(int) - lower, 0, np.array(local.shape) - 1)
    path = [stops[0]]
    for a, b in zip(stops[:-1], stops[1:], strict=True):
        path += route_through_array(cost, a, b, fully_connected=True, geometric=True)[0][1:]
    return smooth_curve(local.to_world(np.array(path)), 0.5, float(volume.spacing.mean()))


def smooth_curve(points: Array, step: float, deviation: float) -> Array:
    """Smoothing spline through points (n, 3), `deviation` mm from them, resampled every `step` mm (m, 3)."""
    keep = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]
    points = points[keep]
    if len(points) < 4:
        return points
    spline, _ = make_splprep(points.T, s=len(points) * deviation**2 / 4)
    dense = spline(np.linspace(0, 1, FINER * len(points))).T
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))]
    targets = np.linspace(0, length[-1], max(round(length[-1] / step), 1) + 1)
    return np.stack([np.interp(targets, length, dense[:, c]) for c in range(3)], axis=1)


def tangents_of(curve: Array) -> Array:
    """Unit tangents (n, 3) of a polyline (n, 3)."""
    difference = np.gradient(curve, axis=0)
    return difference / np.linalg.norm(difference, axis=1, keepdims=True)


def parallel_frames(tangents: Array) -> tuple[Array, Array]:
    """Two unit normals (n, 3) to each tangent, turned no more than the curve itself turns."""
    first = np.empty_like(tangents)
    normal = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    for i, tangent in enumerate(tangents):
        normal = normal - (normal @ tangent) * tangent
        normal = normal / np.linalg.norm(normal)
        first[i] = normal
    return first, np.cross(tangents, first)


def darkness_centre(
    volume: Volume,
    points: Array,
    tangents: Array,
    radius: float,
    bones: Distance | None = None,
    iterations: int = 3,
) -> Sections:
    """Circles fitted to the edges of a dark tube in the planes through points (n, 3) across tangents (n, 3).

    The edge on each ray is where the intensity is half-way to the tissue outside, so that fat on one side and
    muscle on the other do not pull the centre. Rays that enter a bone are left out, since cortical bone is as
    dark as the tube, and those that find nothing darker than muscle. Sections whose edge is not seen keep
    their points and have confidence 0; so have those whose centre is no darker than muscle.
    """
    frames = parallel_frames(tangents)
    centres, radii, seen = points.copy(), np.full(len(points), radius), np.zeros(len(points))
    bright = 1.0
    for _ in range(iterations):
        edge, confidence, directions, bright = _ray_edges(volume, centres, frames, radius, bones)
        shift, radii, seen = _fit_circles(edge, confidence, directions[0], radius)
        size = np.linalg.norm(shift, axis=1, keepdims=True)
        shift *= np.minimum(1, radius / np.maximum(size, 1e-12))
        centres = centres + shift[:, :1] * frames[0] + shift[:, 1:] * frames[1]
    return Sections(centres, radii, seen * _darkness(volume.sample(centres) / bright))


def _darkness(level: Array) -> Array:
    """1 for what is as dark as a tube, 0 for what is as bright as muscle, by its part of the bright level."""
    return np.clip((DARK - level) / (0.25 * DARK), 0, 1)


def _ray_edges(
    volume: Volume, centres: Array, frames: tuple[Array, Array], radius: float, bones: Distance | None
) -> tuple[Array, Array, tuple[Array, Array], float]:
    """Distance (n, RAYS) of a tube's edge along rays, its confidence, the rays' courses, the bright level.

    The courses are in the plane and in the world; the bright level is that of the bright tissue.
    """
    angle = 2 * np.pi * np.arange(RAYS) / RAYS
    plane = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    world = plane[:, 0, None] * frames[0][:, None] + plane[:, 1, None] * frames[1][:, None]
    offsets = np.arange(0, 2 * radius + BEYOND, STEP)
    samples = centres[:, None, None] + offsets[:, None] * world[:, :, None]
    values = volume.sample(samples)
    bright = float(np.percentile(values, BRIGHT))
    free = np.ones(values.shape, bool)
    if bones is not None:
        signed = bones.signed(samples[:, :, ::4].reshape(-1, 3))[0].reshape(*values.shape[:2], -1)
        free = np.repeat(signed > CLEAR, 4, axis=2)[:, :, : len(offsets)]
    edge, rise, dark = _first_rise(values, offsets, CONTRAST * bright)
    before = offsets[None, None] <= edge[..., None] + EDGE_WIDTH
    hidden = (before & ~free).any(axis=2)
    confidence = np.clip(rise / (2 * CONTRAST * bright), 0, 1) * ~hidden
    confidence *= _darkness(dark / bright)
    confidence *= np.exp(-((np.maximum(np.abs(edge - radius) - OFF * radius, 0) / (SPREAD * radius)) ** 2))
    return edge, confidence, (plane, world), bright


def _first_rise(values: Array, offsets: Array, contrast: float) -> tuple[Array, Array, Array]:
    """Along the last axis: where intensity first rises half-way to the next maximum, by how much, from what.

    The rise is 0 where it never exceeds `contrast`.
    """
    lowest = np.minimum.accumulate(values, axis=2)
    risen = values - lowest > contrast
    found = risen.any(axis=2)
    start = np.where(found, np.argmax(risen, axis=2), len(offsets) - 1)
    window = np.arange(len(offsets))
    ahead = (window >= start[..., None]) & (window <= start[..., None] + round(AHEAD / STEP))
    top = np.where(ahead, values, -np.inf).max(axis=2)
    dark = np.take_along_axis(lowest, start[..., None], axis=2)[..., 0]
    half = 0.5 * (top + dark)
    lowest_at = np.argmax(values <= dark[..., None], axis=2)
    above = (values > half[..., None]) & (window > lowest_at[..., None])
    q = np.where(above.any(axis=2), np.maximum(np.argmax(above, axis=2), 1), 1)
    low = np.take_along_axis(values, q[..., None] - 1, axis=2)[..., 0]
    high = np.take_along_axis(values, q[..., None], axis=2)[..., 0]
    part = np.clip((half - low) / np.where(high > low, high - low, 1), 0, 1)
    return offsets[q - 1] + part * (offsets[1] - offsets[0]), np.where(found, top - dark, 0.0), dark


def _fit_circles(edge: Array, confidence: Array, plane: Array, radius: float) -> tuple[Array, Array, Array]:
    """Circles (centre (n, 2), radius (n,)) through edge points on rays, and the share of rays that count.

    Linear in the centre and in r^2 - |centre|^2, reweighted; a weak prior decides where few edges are
    visible.
    """
    points = edge[..., None] * plane
    system = np.concatenate([2 * points, np.ones((*edge.shape, 1))], axis=2)
    target = (points**2).sum(axis=2)
    weights = confidence
    prior = np.diag([PRIOR[0] * radius**2, PRIOR[0] * radius**2, PRIOR[1]])
    for _ in range(5):
        h = np.einsum("nr,nri,nrj->nij", weights, system, system) + prior
        g = np.einsum("nr,nri,nr->ni", weights, system, target) + prior @ np.array([0, 0, radius**2])
        solution = np.linalg.solve(h, g[..., None])[..., 0]
        centre = solution[:, :2]
        radii = np.sqrt(np.maximum(solution[:, 2] + (centre**2).sum(axis=1), SMALLEST))
        miss = np.linalg.norm(points - centre[:, None], axis=2) - radii[:, None]
        weights = confidence / (1 + (miss / (OUTLIER * radius)) ** 2) ** 2
    return centre, radii, weights.mean(axis=1)


def tube_surface(volume: Volume, centreline: Array, radius: float, bones: Distance | None = None) -> Surface:
    """Closed surface of the dark tube around a centreline.

    The edge's distance from the centreline is a smooth function of place and angle, fitted to the visible
    edges.

    Parameters
    ----------
    volume : Volume
        Image in which the tube is darker than its surroundings.
    centreline : array (n, 3)
        Points of the tube's axis in order, in world mm.
    radius : float
        Usual radius in mm. The surface stays between 0.3 and 2 radii from the centreline, or nearer at bones.
    bones : Distance, optional
        Distances to the bones. The tube is cut back so that it does not enter them.

    Returns
    -------
    Surface
        Tube with its ends closed, in world mm.

    Raises
    ------
    ConvergenceError
        If the smooth distance does not converge.
    """
    frames = parallel_frames(tangents_of(centreline))
    edge, confidence, (_, world), _ = _ray_edges(volume, centreline, frames, radius, bones)
    n = len(centreline)
    measured = np.r_[edge.ravel(), np.full(edge.size, radius)]
    weights = np.r_[confidence.ravel(), np.full(edge.size, UNSEEN)]
    total = weights[: edge.size] + weights[edge.size :]
    mean = (weights * measured).reshape(2, -1).sum(axis=0) / total
    field, _ = smooth_field(_cylinder_laplacian(n), mean, total, STIFFNESS, UNLIKE * radius)
    distance = np.clip(field.reshape(n, RAYS), RANGE[0] * radius, RANGE[1] * radius)
    if bones is not None:
        distance = _short_of_bones(centreline, world, distance, bones)
    rings = centreline[:, None] + distance[..., None] * world
    return _closed_tube(rings, centreline)


def _cylinder_laplacian(n: int) -> sp.csr_matrix:
    """Graph Laplacian of n rings of RAYS points, mean degree 1."""
    along = sp.diags([-np.ones(n - 1), np.r_[1, np.full(n - 2, 2.0), 1], -np.ones(n - 1)], [-1, 0, 1])
    ring = 2 * sp.identity(RAYS) - sp.eye(RAYS, k=1) - sp.eye(RAYS, k=-1)
    ring = ring - sp.eye(RAYS, k=RAYS - 1) - sp.eye(RAYS, k=1 - RAYS)
    return (sp.kron(along, sp.identity(RAYS)) + sp.kron(sp.identity(n), ring)).tocsr() / 4


def _short_of_bones(centreline: Array, world: Array, distance: Array, bones: Distance) -> Array:
    """Distances (n, RAYS) cut back so that no point of the tube lies inside a bone."""
    for _ in range(4):
        points = centreline[:, None] + distance[..., None] * world
        signed, _, _, normals = bones.signed(points.reshape(-1, 3))
        facing = np.maximum(-np.einsum("ij,ij->i", normals, world.reshape(-1, 3)), FACING)
        distance = distance + (np.minimum(signed, 0) / facing).reshape(distance.shape)
    return np.maximum(distance, THINNEST)


def _closed_tube(rings: Array, centreline: Array) -> Surface:
    """Triangles over rings (n, RAYS, 3), closed by fans about the first and the last centre."""
    n = len(rings)
    ids = np.arange(n * RAYS).reshape(n, RAYS)
    a, b = ids[:-1], ids[1:]
    a2, b2 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    sides = np.concatenate([np.stack([a, a2, b2], axis=2), np.stack([a, b2, b], axis=2)]).reshape(-1, 3)
    first, last = n * RAYS, n * RAYS + 1
    start = np.stack([np.full(RAYS, first), np.roll(ids[0], -1), ids[0]], axis=1)
    end = np.stack([np.full(RAYS, last), ids[-1], np.roll(ids[-1], -1)], axis=1)
    vertices = np.concatenate([rings.reshape(-1, 3), centreline[[0, -1]]])
    return Surface(vertices, np.concatenate([sides, start, end]))
