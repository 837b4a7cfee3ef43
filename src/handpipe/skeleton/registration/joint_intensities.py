"""Registration of bones by how the intensities of two images go together, one relation for all bones.

Fat may be brighter than water in one image and darker in the other, and a voxel of both be black in one of
them: no function carries one contrast to the other. The joint distribution of both intensities holds what
goes with what, mixtures included (Viola and Wells 1997). One bone has too few voxels to tell it, and would
fit it to its own wrong place; all bones of a pose tell it together (Leventon and Grimson 1998).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.optimize import minimize

from handpipe.core import Array, RigidTransform
from handpipe.imaging.volumes import Volume
from handpipe.skeleton.registration.normal_equations import Rows, moved, patch_covariance

BINS = 32  # of each image's intensities
BLUR = 1.0  # bins
RELATED = 0.1  # mean logarithm at a bone; noise has about a hundredth, a foot's echoes 0.4 and more
EMPTY = 1e-3  # voxels that every pair of bins has at least
DARKEST, BRIGHTEST = 0.5, 99.5  # percentiles, beyond which intensities are one
ROUNDS = 2  # of the relation and the places
STEPS = 40  # of one bone at most
STILL = 1e-5  # mean slope of the log likelihood by mm
NEAR = 0.01  # voxels or bins, of numerical slopes
BENT = 0.02  # mm, of numerical second derivatives; at the bone's rim for turns


@dataclass(frozen=True)
class Region:
    """Voxels of one bone in the neutral image, and the other image around its place.

    Parameters
    ----------
    points : array (n, 3)
        The voxels' places in neutral, mm.
    values : array (n,)
        The neutral image there.
    splines : Volume
        Coefficients of cubic splines of the other image.
    middle : array (3,)
        Centre of small motions in neutral, mm.
    """

    points: Array
    values: Array
    splines: Volume
    middle: Array

    @property
    def scale(self) -> Array:
        """What (6,) of a turn in rad and a shift in mm moves the region by about a mm."""
        arm = float(np.linalg.norm(self.points - self.middle, axis=1).mean())
        return np.array([*[1 / arm] * 3, 1.0, 1.0, 1.0])

    def seen(self, transform: RigidTransform) -> Array:
        """The other image (n,) at the moved points."""
        return self._at(self.splines.to_index(transform(self.points)).T)

    def slopes(self, transform: RigidTransform) -> Array:
        """What small motions (6,) change in it, (n, 6)."""
        places = transform(self.points)
        index = self.splines.to_index(places).T
        ahead = np.eye(3)[..., None] * NEAR
        changes = [self._at(index + d) - self._at(index - d) for d in ahead]
        by_voxel = np.stack(changes, axis=-1) / (2 * NEAR)
        by_world = by_voxel @ np.linalg.inv(self.splines.affine[:3, :3])
        return np.hstack([np.cross(places - transform(self.middle), by_world), by_world])

    def correlation(self, transform: RigidTransform) -> float:
        """Correlation of both images' intensities."""
        return float(np.corrcoef(self.values, self.seen(transform))[0, 1])

    def _at(self, index: Array) -> Array:
        values = ndimage.map_coordinates(self.splines.values, index, prefilter=False, mode="nearest")
        return np.asarray(values, float)


@dataclass(frozen=True)
class _Bins:
    """A scale of intensities."""

    low: float
    high: float

    @staticmethod
    def span(values: Array) -> _Bins:
        low, high = np.percentile(values, [DARKEST, BRIGHTEST])
        return _Bins(float(low), float(max(high, low + np.finfo(np.float32).tiny)))

    @property
    def each(self) -> float:
        """Intensity of one bin."""
        return (self.high - self.low) / (BINS - 1)

    def place(self, values: Array) -> Array:
        return np.clip((values - self.low) / self.each, 0, BINS - 1)


@dataclass(frozen=True)
class _Relation:
    """How much likelier a pair of intensities is at one place than by chance: logarithms, as splines."""

    first: _Bins
    second: _Bins
    logs: Array

    @staticmethod
    def measure(first: Array, second: Array) -> _Relation:
        scales = _Bins.span(first), _Bins.span(second)
        places = [scale.place(values) for scale, values in zip(scales, (first, second), strict=True)]
        span = (-0.5, BINS - 0.5)
        counts = np.histogram2d(places[0], places[1], bins=BINS, range=[span, span])[0]
        joint = ndimage.gaussian_filter(counts, BLUR, mode="nearest") + EMPTY
        joint /= joint.sum()
        logs = np.log(joint / np.outer(joint.sum(axis=1), joint.sum(axis=0)))
        return _Relation(*scales, ndimage.spline_filter(logs))

    def logarithms(self, first: Array, second: Array) -> Array:
        return self._at(self.first.place(first), self.second.place(second))

    def slopes(self, first: Array, second: Array) -> Array:
        """Derivatives by the second intensity."""
        i, j = self.first.place(first), self.second.place(second)
        found = (self._at(i, j + NEAR) - self._at(i, j - NEAR)) / (2 * NEAR * self.second.each)
        return np.where((j > 0) & (j < BINS - 1), found, 0.0)

    def _at(self, first: Array, second: Array) -> Array:
        values = ndimage.map_coordinates(self.logs, [first, second], prefilter=False, mode="nearest")
        return np.asarray(values, float)


def place_together(
    regions: Mapping[str, Region], starts: Mapping[str, RigidTransform], bones: Collection[str]
) -> dict[str, tuple[RigidTransform, Array | None]]:
    """The places of all bones at which their intensities go together best.

    Parameters
    ----------
    regions : mapping of str to Region
        Voxels of each bone.
    starts : mapping of str to RigidTransform
        Where each bone is, or starts.
    bones : collection of str
        The bones to place; the others tell the relation from where they are.

    Returns
    -------
    dict of str to tuple of RigidTransform and array (6, 6)
        Transforms of these bones, and their covariances in rad and mm; None where the
        likelihood has no top, or the images have nothing in common.
    """
    placed = dict(starts)
    relation = _relation(regions, placed)
    for _ in range(ROUNDS):
        relation = _relation(regions, placed)
        placed |= {name: _climbed(regions[name], relation, placed[name]) for name in bones}
    return {name: (placed[name], _covariance(regions[name], relation, placed[name])) for name in bones}


def _relation(regions: Mapping[str, Region], placed: Mapping[str, RigidTransform]) -> _Relation:
    """The relation that all bones at their places show."""
    first = np.concatenate([region.values for region in regions.values()])
    second = np.concatenate([region.seen(placed[name]) for name, region in regions.items()])
    return _Relation.measure(first, second)


def _climbed(region: Region, relation: _Relation, start: RigidTransform) -> RigidTransform:
    """The nearest place of the greatest likelihood."""
    scale = region.scale

    def falling(step: Array) -> tuple[float, Array]:
        here = moved(start, step * scale, region.middle)
        logs = relation.logarithms(region.values, region.seen(here))
        return -float(logs.mean()), -_scores(region, relation, here).mean(axis=0) * scale

    options = {"gtol": STILL, "maxiter": STEPS}
    found = minimize(falling, np.zeros(6), jac=True, method="BFGS", options=options)
    return moved(start, found.x * scale, region.middle)


def _scores(region: Region, relation: _Relation, here: RigidTransform) -> Array:
    """What small motions (n, 6) change in the logarithm of each voxel's likelihood."""
    return relation.slopes(region.values, region.seen(here))[:, None] * region.slopes(here)


def _covariance(region: Region, relation: _Relation, here: RigidTransform) -> Array | None:
    """The spread of what parts of the region pull, by the likelihood's curvature; None where none tells."""
    if relation.logarithms(region.values, region.seen(here)).mean() < RELATED:
        return None
    steps = np.diag(BENT * region.scale)
    pulls = [
        [_scores(region, relation, moved(here, way * step, region.middle)).sum(axis=0) for way in (1, -1)]
        for step in steps
    ]
    curvature = np.stack([(b - a) / (2 * h) for (a, b), h in zip(pulls, np.diag(steps), strict=True)])
    curvature = (curvature + curvature.T) / 2
    if np.linalg.eigvalsh(curvature * np.outer(region.scale, region.scale)).min() <= 0:
        return None
    rows = Rows(_scores(region, relation, here), np.ones(len(region.points)))
    return patch_covariance(
        rows, np.ones(len(region.points)), region.points, np.asarray(np.linalg.inv(curvature))
    )
