"""The map of the field in which fat and water are told apart.

Each voxel leaves several values of the field possible: in one of them its fat is water. Fields are smooth, so
values are chosen voxel by voxel from where they are surest outwards, each closest to its neighbours' (region
growing, Yu 2005), and then again, all at once, until none changes.
"""

from __future__ import annotations

import heapq
import logging
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter, label, minimum
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray, IntArray
from handpipe.imaging.fat_water.echo_signal import MAIN_PEAK, Complex, EchoSignal, abs2

log = logging.getLogger(__name__)

WIDEST = 6.0  # ppm to either side within which the field is searched for
STEPS = 64  # of the search, from water to fat
MOST = 8  # values of the field that a voxel leaves possible
WORST = 0.3  # of a voxel's energy, by which a possible value may fit worse than the best one
REACH = 5.0  # mm around a voxel whose neighbours predict its field
BLOCK = 4000  # voxels fitted at a time
SWEEPS = 30  # over all voxels, at most
LARGE = 200  # voxels: a part of tissue that is named if its map is doubtful
JUMP = 0.3  # of the shift between fat and water: step across air above which it is doubtful
PAIRS = 100  # of voxels closest to one another, across the air between two parts
SMOOTH = 1.0  # mm: deviation of the Gaussian over the map that is used
GAP_OF_NOISE = 0.1  # of the gap between fat and water: step that a voxel of typical energy counts as
AMBIGUOUS = 0.03  # of the energy, by which another map may fit better than the one of the smaller field
UNSURE = 0.6  # of the median field of the next best map: a median beyond decides nothing
NEXT = 1.01  # voxels that a window reaches at least: its next neighbours


@dataclass(frozen=True)
class FieldGrid:
    """Number of voxels along each axis, and their size (3,) in mm."""

    shape: tuple[int, ...]
    spacing: Array


@dataclass(frozen=True)
class PossibleFields:
    """Values of the field that the signal of each voxel leaves possible.

    values (m, k) in Hz, NaN where a voxel has fewer; weights (m,): its energy; voxels (m, 3): its indices.
    """

    values: Array
    weights: Array
    voxels: IntArray

    @classmethod
    def find(cls, signals: Complex, tissue: BoolArray, echoes: EchoSignal) -> PossibleFields:
        """Those of the voxels of `tissue` (nx, ny, nz), from signals (nx, ny, nz, n)."""
        inside = signals[tissue]
        blocks = [_minima(inside[i : i + BLOCK], echoes) for i in range(0, len(inside), BLOCK)]
        return cls(np.concatenate(blocks), abs2(inside).sum(axis=1), np.argwhere(tissue))

    def nearest(self, predicted: Array) -> Array:
        """The possible value (m,) nearest to a predicted one."""
        apart = np.abs(self.values - predicted[:, None])
        return np.take_along_axis(self.values, np.nanargmin(apart, axis=1)[:, None], axis=1)[:, 0]

    def spread(self, field: Array, grid: FieldGrid, reach: float) -> Array:
        """The field (m,) averaged by energy over a Gaussian of `reach` mm, at the same voxels."""
        at = tuple(self.voxels.T)
        whole, weight = np.zeros(grid.shape), np.zeros(grid.shape)
        whole[at], weight[at] = self.weights * field, self.weights
        smooth = [gaussian_filter(a, reach / grid.spacing, mode="constant")[at] for a in (whole, weight)]
        return np.asarray(smooth[0] / smooth[1])


def _minima(signals: Complex, echoes: EchoSignal) -> Array:
    """Local minima (m, MOST) of the fits' residuals over the field, the best ones first."""
    limit = np.ceil(STEPS * WIDEST / -MAIN_PEAK)
    step = echoes.fat_shift / STEPS
    fields = step * np.arange(-limit, limit + 1)
    left = echoes.residuals(signals, fields)
    before, here, after = left[:, :-2], left[:, 1:-1], left[:, 2:]
    lowest = (here <= before) & (here < after)
    curvature = np.where(lowest, before - 2 * here + after, 1.0)
    refined = fields[1:-1] + 0.5 * step * (before - after) / curvature
    good = lowest & (here <= here.min(axis=1, keepdims=True) + WORST * abs2(signals).sum(axis=1)[:, None])
    good[:, 0] |= ~good.any(axis=1)  # a signal of zeros
    order = np.argsort(np.where(good, here, np.inf), axis=1)[:, :MOST]
    found = np.take_along_axis(np.where(good, refined, np.nan), order, axis=1)
    return np.asarray(found)


@dataclass(frozen=True)
class FieldMap:
    """The field (m,) in Hz of the voxels of tissue, and how sure it is.

    residual: share of the signals' energy that it leaves; better: by how much less the best other map leaves,
    negative where it leaves more; margin: median of that map's field by its own median, without signs.
    """

    field: Array
    residual: float
    better: float
    margin: float

    @property
    def doubtful(self) -> bool:
        """Whether fat and water may be exchanged in the whole image."""
        return self.margin > UNSURE and self.better > -AMBIGUOUS


def field_map(possible: PossibleFields, signals: Complex, echoes: EchoSignal, grid: FieldGrid) -> FieldMap:
    """The smooth map of the smallest field among those that fit the signals (m, n) about as well.

    A map in which all fat is water fits as well at some echo times. The scanner is tuned to water, so the
    true field is the smaller one.
    """
    grown = grow(possible, grid, echoes.fat_shift)
    smooth = possible.spread(grown, grid, REACH / 2)
    maps = [grown, *(possible.nearest(smooth + by) for by in (echoes.fat_shift, -echoes.fat_shift))]
    energy = possible.weights.sum()
    left = [float(_left(signals, echoes, field).sum() / energy) for field in maps]
    size = [abs(float(np.median(field))) for field in maps]
    fitting = [i for i in range(len(maps)) if left[i] <= min(left) + AMBIGUOUS]
    best = min(fitting, key=lambda i: size[i])
    other = min(
        (i for i in range(len(maps)) if i != best), key=lambda i: (left[i] > min(left) + AMBIGUOUS, size[i])
    )
    field = possible.spread(maps[best], grid, SMOOTH)
    return FieldMap(field, left[best], left[best] - left[other], size[best] / max(size[other], 1e-9))


def _left(signals: Complex, echoes: EchoSignal, field: Array) -> Array:
    """Energy (m,) that the fit leaves in a known field (m,)."""
    blocks = [slice(i, i + BLOCK) for i in range(0, len(signals), BLOCK)]
    return np.concatenate([echoes.residuals(signals[b], field[b, None])[:, 0] for b in blocks])


def grow(possible: PossibleFields, grid: FieldGrid, shift: float) -> Array:
    """One value of the field (m,) in Hz for each voxel, smooth over all of them.

    shift: Hz between fat and water, the unit of gaps between neighbours.
    """
    index = np.full(grid.shape, -1, np.int64)
    index[tuple(possible.voxels.T)] = np.arange(len(possible.voxels))
    typical = float(np.median(possible.weights))
    weights = possible.weights / typical + 1e-6
    field = _grown(possible.values, weights, possible.voxels, index, _window(grid.spacing), shift)
    field = _linked(possible, field, grid, shift)
    for _ in range(SWEEPS):
        chosen = possible.nearest(possible.spread(field, grid, REACH / 2))
        if np.array_equal(chosen, field):
            break
        field = chosen
    return field


def _linked(possible: PossibleFields, field: Array, grid: FieldGrid, shift: float) -> Array:
    """The field with one map for all parts of the tissue: across air its steps are the smallest ones."""
    tissue = np.zeros(grid.shape, bool)
    tissue[tuple(possible.voxels.T)] = True
    part = label(tissue, np.ones((3, 3, 3)))[0][tuple(possible.voxels.T)]
    places = possible.voxels * grid.spacing
    field = field.copy()
    known = part == np.bincount(part).argmax()
    while not known.all():
        left = np.flatnonzero(~known)
        apart, nearest = cKDTree(places[known]).query(places[left])
        steps = field[left] - field[known][nearest]
        numbers = np.unique(part[left])
        near = numbers[minimum(apart, part[left], numbers) <= max(2 * apart.min(), REACH)]
        for number in near:
            own = np.flatnonzero(part[left] == number)
            pairs = own[np.argsort(apart[own], kind="stable")[:PAIRS]]
            step = float(np.median(steps[pairs]))
            field[left[own]] -= shift * np.round(step / shift)
            _tell(step - shift * np.round(step / shift), possible.voxels[left[own]], shift)
        known |= np.isin(part, near)
    return possible.nearest(field)


def _tell(step: float, voxels: IntArray, shift: float) -> None:
    """Name a part of tissue whose map is hardly the better one of two."""
    if len(voxels) >= LARGE and abs(step) > JUMP * shift:
        middle = np.rint(voxels.mean(axis=0)).astype(int)
        log.warning(
            "the part of %d voxels around voxel %s: the field differs by %.0f Hz from the nearest tissue: "
            "fat and water may be exchanged in it; look at the images",
            *(len(voxels), tuple(middle.tolist()), step),
        )


def _window(spacing: Array) -> tuple[IntArray, Array]:
    """Offsets (k, 3) of the voxels around one, and their weights; along each axis one voxel at least."""
    reach = np.maximum(REACH / spacing, NEXT)
    grid = [np.arange(-int(r), int(r) + 1) for r in reach]
    offsets = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 3)
    apart = np.linalg.norm(offsets * spacing, axis=1)
    near = (((offsets / reach) ** 2).sum(axis=1) <= 1) & (apart > 0)
    return offsets[near], np.exp(-0.5 * (apart[near] / (REACH / 2)) ** 2) + 1e-6


@njit(cache=True)
def _grown(values, weights, voxels, index, window, shift):  # type: ignore[no-untyped-def]
    """Values chosen from the voxel of most energy outwards, the smallest steps of the field first.

    What this cannot reach starts anew, at the smallest value.
    """
    offsets, nearness = window
    field = np.full(len(values), np.nan)
    heap = [(0.0, 0)]
    heap.clear()
    for start in np.argsort(-weights):
        if np.isnan(field[start]):
            field[start] = _closest(values[start], 0.0)
            _push(heap, start, field, (values, weights, voxels, index, offsets, nearness, shift))
        while len(heap):
            v = heapq.heappop(heap)[1]
            if np.isnan(field[v]):
                field[v] = _closest(
                    values[v], _predicted(voxels[v], field, weights, index, (offsets, nearness))
                )
                _push(heap, v, field, (values, weights, voxels, index, offsets, nearness, shift))
    return field


@njit(cache=True)
def _push(heap, v, field, given):  # type: ignore[no-untyped-def]
    """Queue the neighbours of a voxel whose field is not known, by the step that they would make."""
    values, weights, at, index, offsets, nearness, shift = given
    for o in range(len(offsets)):
        if np.abs(offsets[o]).sum() != 1:
            continue
        u = _at(index, at[v] + offsets[o])
        if u >= 0 and np.isnan(field[u]):
            guess = _predicted(at[u], field, weights, index, (offsets, nearness))
            step = abs(_closest(values[u], guess) - guess) / shift
            heapq.heappush(heap, (step + GAP_OF_NOISE / np.sqrt(weights[u]), u))


@njit(cache=True)
def _at(index, place):  # type: ignore[no-untyped-def]
    """Number of the voxel at a place of the grid, -1 where there is none."""
    for c in range(3):
        if place[c] < 0 or place[c] >= index.shape[c]:
            return -1
    return index[place[0], place[1], place[2]]


@njit(cache=True)
def _predicted(place, field, weights, index, window):  # type: ignore[no-untyped-def]
    """Mean of the known field around a place of the grid, by energy and nearness; one neighbour is known."""
    offsets, nearness = window
    total, weight = 0.0, 0.0
    for o in range(len(offsets)):
        u = _at(index, place + offsets[o])
        if u >= 0 and not np.isnan(field[u]):
            share = weights[u] * nearness[o]
            total += share * field[u]
            weight += share
    return total / weight


@njit(cache=True)
def _closest(values, predicted):  # type: ignore[no-untyped-def]
    """The value nearest to a predicted one; NaN stands for none."""
    found = predicted
    best = np.inf
    for value in values:
        if abs(value - predicted) < best:
            best, found = abs(value - predicted), value
    return found
