"""The skin's edge below the voxel size: where the profile along the normal falls like a blurred step to air.

The tissue at the edge is about a voxel of dermis, and brighter or darker than what lies under it. A level
half-way from air to the tissue some voxels inside would lie in the dermis or outside of it, depending on the
echo. Of a blurred step the outer flank alone tells place and height together.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import cKDTree
from scipy.special import erfc

from handpipe.core import Array, BoolArray
from handpipe.imaging.evidence.profiles import BLUR, graph_laplacian, smooth_field, summed_curvature
from handpipe.imaging.skin.body_voxels import Air
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface, taubin

STEP = 0.1  # voxels between samples of a profile
REACH = 1.5  # voxels that the edge may lie off the surface
INWARDS, OUTWARDS = 0.3, 1.5  # voxels either side of the edge at which the step is looked at
ROUNDS = 3  # in which the surface moves onto the edge
STIFFNESS = 1.0  # of the skin's smooth move against a measurement of full confidence
OUTLIER = 0.5  # voxels from the neighbours' edge
AT_CONTACT = 1.8  # voxels from a contact, within which it gives the edge
GAP = 0.3  # voxels between parts that touch
ALIKE = 0.97  # correlation of a profile with the step, from which it is one
BESIDE = 0.7  # voxels beside a surface's normal, at most, to a contact that gives its edge
UNLIKE = 0.02  # of correlation below `ALIKE`, by which confidence falls to a third


def refined(
    volume: Volume, surface: Surface, air: Air, free: BoolArray, contacts: Array
) -> tuple[Surface, Array]:
    """A surface moved along its normals on to the skin's edge, and each vertex's confidence (n,).

    A vertex whose profile shows no edge follows its neighbours. Only free vertices (n,) move. At contacts,
    known by places (k, 3) on them, the surface ends a little before the contact.
    """
    touching = cKDTree(contacts) if len(contacts) else None
    laplacian = graph_laplacian(surface.triangles, len(surface.vertices))
    voxel = float(volume.spacing.min())
    weights = np.zeros(len(surface.vertices))
    for _ in range(ROUNDS):
        offset, confidence = edge_offsets(volume, surface, air)
        if touching is not None:
            offset, confidence = _before_contacts(surface, touching, voxel, offset, confidence)
        move, weights = smooth_field(laplacian, offset, confidence * free, STIFFNESS, OUTLIER * voxel)
        moved = surface.vertices + move[:, None] * surface.vertex_normals()
        smooth = taubin(surface.moved(moved), 3)
        surface = smooth.moved(np.where(free[:, None], smooth.vertices, surface.vertices))
    return surface, weights


def _before_contacts(
    surface: Surface, contacts: cKDTree, voxel: float, offset: Array, confidence: Array
) -> tuple[Array, Array]:
    """Offsets and confidences (n,) of the edge, with those of vertices at contacts half a gap before them."""
    off, nearest = contacts.query(surface.vertices, k=1)
    way = contacts.data[nearest] - surface.vertices
    along = np.einsum("ij,ij->i", way, surface.vertex_normals())
    at = (off < AT_CONTACT * voxel) & (np.linalg.norm(way, axis=1) < abs(along) + BESIDE * voxel)
    return np.where(at, along - 0.5 * GAP * voxel, offset), np.where(at, 1.0, confidence)


def edge_offsets(volume: Volume, surface: Surface, air: Air) -> tuple[Array, Array]:
    """Offsets (n,) in mm of the skin's edge along the normals of a surface, and confidences (n,) in [0, 1].

    Blur moves the edge of a curved surface by half its variance times the summed curvature: the offsets are
    moved back by that.
    """
    normals = surface.vertex_normals()
    voxel = np.linalg.norm(normals @ volume.affine[:3, :3], axis=1)
    depth = np.arange(-REACH - INWARDS, REACH + OUTWARDS + 1e-9, STEP)
    profiles = volume.sample(
        surface.vertices[:, None] + (voxel[:, None] * depth)[..., None] * normals[:, None]
    )
    outside = volume.like(air.level).sample(surface.vertices)
    signal = _signal(np.maximum(profiles, outside[:, None]), outside, air)
    place, height, likeness = _steps(signal)
    clear: BoolArray = height > 4 * air.noise
    confidence = clear * np.exp(-np.maximum(ALIKE - likeness, 0.0) / UNLIKE)
    shift = 0.5 * (BLUR * voxel) ** 2 * np.clip(summed_curvature(surface), -1 / voxel, 1 / voxel)
    return place * voxel + shift, np.asarray(confidence, float)


def _signal(seen: Array, outside: Array, air: Air) -> Array:
    """Signal (n, m) above that of air; the noise lifts the magnitude where there is little."""
    if air.signal > 0:
        return seen - outside[:, None]
    lifted = np.sqrt(np.maximum(seen**2 - air.noise**2, 0.0))
    return lifted - np.sqrt(np.maximum(outside[:, None] ** 2 - air.noise**2, 0.0))


def _steps(signal: Array) -> tuple[Array, Array, Array]:
    """Place (n,) in voxels and height of the blurred step that each profile is most like, and how alike.

    The likeness is the cosine between profile and step in a window around the step.
    """
    window = np.arange(-INWARDS, OUTWARDS + 1e-9, STEP)
    step = 0.5 * erfc(window / (BLUR * math.sqrt(2)))
    views = sliding_window_view(signal, len(window), axis=1)
    product = views @ step
    norms = np.sqrt(np.einsum("nkw,nkw->nk", views, views))
    likeness = product / np.maximum(norms * np.linalg.norm(step), 1e-12)
    best = np.clip(np.argmax(likeness, axis=1), 1, likeness.shape[1] - 2)
    rows = np.arange(len(best))
    before, at, after = (likeness[rows, best + i] for i in (-1, 0, 1))
    bend = before - 2 * at + after
    share = np.clip(0.5 * (before - after) / np.where(bend < 0, bend, -1.0), -0.5, 0.5) * (bend < 0)
    place = -REACH + STEP * (best + share)
    return place, product[rows, best] / float(step @ step), at
