"""A skin made around real organs: a few mm beyond all of them, hollows and webs filled, cut at the wrist.

Organs are moved outwards by much and back by less (a closing), which fills gaps narrower than that. The
palm and each finger are closed by themselves, so that fingers stay apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.generation import Grid, isosurface, remesh, smooth_minimum
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.phantom.hand_tissue import Cone, Layout, cone_rows, field_of_cones

Box = tuple[slice, slice, slice]

SPACING = 0.8  # mm of the grid
CREASE = 1.4  # mm, standard deviation of the smoothing
ROUNDING = 6.0  # mm of the cut's edge
BLEND = 4.0  # mm over which fingers run into the palm
PALM_SHARE = 0.42  # of a proximal phalanx that belongs to the palm: where webs end


@dataclass(frozen=True)
class Closing:
    """By how much organs go outwards and how much of that stays, in mm."""

    outwards: float
    thickness: float


PALM, FINGER = Closing(11.0, 3.2), Closing(7.0, 3.2)  # mm


def skin_around(
    organs: Sequence[Surface], bones: Mapping[str, Surface], layout: Layout, wrist: float, edge_length: float
) -> Surface:
    """The closed skin around organs and bones in neutral, which may be open or overlap.

    wrist: where the hand is cut, in mm along x; triangles of about `edge_length` mm.
    """
    grid = _grid(np.concatenate([bone.vertices for bone in bones.values()]), wrist)
    filled = occupied([*organs, *bones.values()], grid)
    filled |= field_of_cones(cone_rows(pulp(layout), layout.frames), grid) < 0
    places = np.argwhere(filled)
    ray = _rays(grid.origin + SPACING * places, bones, layout)
    outline = np.full(grid.shape, PALM.outwards)
    for number in np.unique(ray):
        closing = PALM if number == 0 else FINGER
        box, field = _closed_part(places[ray == number], closing, grid.shape)
        outline[box] = smooth_minimum(outline[box], field, BLEND)
    beyond = wrist - grid.points()[:, 0].reshape(grid.shape)
    outline = -smooth_minimum(-outline, -beyond, ROUNDING)
    smooth = gaussian_filter(outline, CREASE / SPACING)
    return remesh(isosurface(smooth, grid).largest_component().compact(), edge_length)


def _grid(points: Array, wrist: float) -> Grid:
    """Around points (n, 3) of bones, from some mm before the wrist on, with room for organs' flesh."""
    before = np.array([wrist - ROUNDING, *points.mean(axis=0)[1:]])
    whole = Grid.around(np.vstack([points, before]), PALM.outwards + 3 * SPACING, SPACING)
    first = int((before[0] - whole.origin[0]) / SPACING)
    origin = whole.origin + np.array([first * SPACING, 0.0, 0.0])
    return Grid(origin, SPACING, (whole.shape[0] - first, *whole.shape[1:]))


def occupied(surfaces: Sequence[Surface], grid: Grid) -> BoolArray:
    """Which points of a grid surfaces wind around."""
    filled = np.zeros(grid.shape, dtype=bool)
    for surface in surfaces:
        low = np.floor((surface.vertices.min(axis=0) - grid.origin) / grid.spacing).astype(int)
        high = np.ceil((surface.vertices.max(axis=0) - grid.origin) / grid.spacing).astype(int) + 1
        low, high = np.clip(low, 0, grid.shape), np.clip(high, 0, grid.shape)
        if (high <= low).any():
            continue
        points = grid.origin + grid.spacing * (np.indices(high - low).reshape(3, -1).T + low)
        filled[_box(low, high)] |= surface.contains(points).reshape(high - low)
    return filled


def _closed_part(places: IntArray, closing: Closing, shape: tuple[int, ...]) -> tuple[Box, Array]:
    """The closing of a grid's points (n, 3) by number, and the box of the grid that it is in."""
    margin = int(closing.outwards / SPACING) + 3
    low = np.maximum(places.min(axis=0) - margin, 0)
    high = np.minimum(places.max(axis=0) + margin + 1, shape)
    own = np.zeros(high - low, dtype=bool)
    own[tuple((places - low).T)] = True
    return _box(low, high), closed(own, closing)


def _box(low: IntArray, high: IntArray) -> Box:
    return slice(low[0], high[0]), slice(low[1], high[1]), slice(low[2], high[2])


def closed(filled: BoolArray, closing: Closing) -> Array:
    """Approximate distance in mm, negative inside, to the closing of a grid's filled voxels."""
    outside = SPACING * distance_transform_edt(~filled)
    inside = SPACING * distance_transform_edt(outside < closing.outwards)
    return np.where(inside > 0, closing.outwards - closing.thickness - inside, outside - closing.thickness)


def pulp(layout: Layout) -> list[Cone]:
    """Cones along the phalanges for the flesh that no organ stands for; the skin goes round them."""
    cones = []
    for chain in layout.chains.values():
        for name, length, girth in chain:
            kind = name[:-1]
            if kind == "metacarpal":
                continue
            radius = {"proximal": 6.6, "middle": 5.6, "distal": 4.6}[kind] * girth**0.5
            end = length + 0.5 if kind == "distal" else length
            low = -2.2 if kind == "distal" else -1.6
            cones.append(Cone((name, (0, 0, low)), (name, (end - radius / 2, 0, low)), radius, 0.95 * radius))
    return cones


def _rays(points: Array, bones: Mapping[str, Surface], layout: Layout) -> IntArray:
    """The ray (n,) of the phalanx that is nearest to each point (n, 3), 0 for the palm."""
    corners, owner = [], []
    for name, bone in bones.items():
        ray, start = 0, bone.vertices
        for number, chain in layout.chains.items():
            for link, length, _ in chain[1:]:
                if link == name:
                    along = layout.frames[name].inverse()(start)[:, 0]
                    out = along > (PALM_SHARE * length if name.startswith("proximal") else -np.inf)
                    owner.append(np.where(out, number, 0))
                    ray = number
        corners.append(start)
        if ray == 0:
            owner.append(np.zeros(len(start), dtype=np.int64))
    return np.concatenate(owner)[cKDTree(np.concatenate(corners)).query(points)[1]]
