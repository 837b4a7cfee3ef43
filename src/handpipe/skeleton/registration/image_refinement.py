"""Refinement of a bone's registration by the images in its own region: edges of one image on the other's.

A surface of nearly round cross-sections hardly tells a roll, and its border moves with the contrast. The
image within the bone and on it tells more: texture, vessels, the cortex's thickness, attachments.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy import ndimage
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from handpipe.core import Array, BoolArray, RigidTransform, evenly
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration.edge_directions import edge_directions
from handpipe.skeleton.registration.joint_intensities import Region, place_together
from handpipe.skeleton.registration.normal_equations import (
    Rows,
    larger,
    moved,
    patch_covariance,
    robust_weights,
    solve,
)
from handpipe.skeleton.registration.registration import APART

LOG = logging.getLogger(__name__)

AROUND = 2.0  # voxels of other tissue around a bone that move with it: cortex, and what lies on it
RIM = 5  # voxels around the region that gradients and splines need
FEWEST = 300  # voxels of a region
ITERATIONS = 30  # steps at most
STILL = 1e-5  # rad, and mm
CLEARLY = 2 / 3  # of one minus the cosine at every other place: a place with less is the one that images show
RELATED = 0.5  # cosine of the edges' directions; a foot's echoes of unlike contrast have more
ALIKE = 0.9  # correlation of intensities in the region, from which on the images show one contrast
SPREAD = 3.0  # times the patches' spread: errors of one foot's images by what patches state
MOST = 20000  # voxels of a region that intensities are compared in
ENOUGH = 5000  # voxels of all regions, about five for each pair of bins of the joint distribution
FEWEST_BONES = (
    8  # that one relation of intensities is fitted to: of three, one came out 3.3 deg off, stated 0.6
)
FARTHEST = 3.0  # stated deviations of the surfaces' registration, beyond which images show something else
LEAST_FARTHEST = np.array([np.radians(3.0), 1.0])  # rad and voxels that this is taken of at least
KNOWN = 0.5  # deg that surfaces state of a turn, up to which it is kept: enough for a rig
BETTER = 0.75  # of the turn's deviation by surfaces that images state at most: tissue on a bone may slide


@dataclass(frozen=True)
class PoseImages:
    """Images of neutral and of a pose, and the neutral bones, whose registrations they refine.

    Parameters
    ----------
    neutral, target : Volume
        The images.
    bones : mapping of str to Surface
        Whole neutral bones by name, mm.
    """

    neutral: Volume
    target: Volume
    bones: Mapping[str, Surface]

    def chosen(self, bone: str, places: Sequence[Registration]) -> int | None:
        """Which of several places of a bone the images show.

        Parameters
        ----------
        bone : str
            Name of the bone.
        places : sequence of Registration
            Places that fit its surfaces nearly as well, such as half a turn about its long axis.

        Returns
        -------
        int or None
            The number of the place with the largest cosine between both images' edges, after a refinement
            by the images. None if that cosine is at most `RELATED`, or if one minus it is not below `CLEARLY`
            times that of each place more than `APART` away.
        """
        crop, distance = self._region(bone)
        region = np.isfinite(distance)
        if np.count_nonzero(region) < FEWEST:
            return None
        pair = _Pair.build(crop, region, self.target, [p.transform for p in places], self._middle(bone))
        ends = [pair.aligned(place.transform)[0] for place in places]
        related = np.array([pair.related(end) for end in ends])
        best = int(related.argmax())
        others = [r for r, end in zip(related, ends, strict=True) if end.angle_to(ends[best]) > APART]
        clear = all(1 - related[best] < CLEARLY * (1 - other) for other in others)
        found = best if related[best] > RELATED and clear else None
        taken = "images choose none" if found is None else f"images choose number {found}"
        LOG.info("%s: cosines of the edges at its places %s; %s", bone, np.round(related, 3), taken)
        return found

    def refined(self, bone: str, found: Registration) -> Registration:
        """A bone's registration by its surfaces, its turn refined by the images.

        Parameters
        ----------
        bone : str
            Name of the bone.
        found : Registration
            Registration of its surfaces.

        Returns
        -------
        Registration
            The registration turned about the bone's middle, with its covariance. A bone keeps its
            registration where the surfaces know its turn to half a degree, and where the images do not
            know it better by a quarter. Images of different contrast leave the deviation that the
            surfaces state; where both ways differ by more than this, the surfaces' transform is kept and
            its covariance holds the difference. Tissue slides on a bone: the covariance also holds how far
            the turn differs from that of the bone's own voxels.
        """
        if found.rotation_deviation < KNOWN:
            return found
        crop, distance = self._region(bone)
        region = np.isfinite(distance)
        if np.count_nonzero(region) < FEWEST:
            LOG.warning("%s: too few voxels to refine its registration by the images", bone)
            return found
        pair = _Pair.build(crop, region, self.target, [found.transform], self._middle(bone))
        transform, covariance = pair.aligned(found.transform)
        related = pair.related(transform)
        if related < RELATED:
            LOG.warning(
                "%s: its images have little in common (%.2f); its surfaces tell its place", bone, related
            )
            return found
        turned = _turned(found, transform, covariance, self._middle(bone))
        if turned.rotation_deviation > BETTER * found.rotation_deviation:
            LOG.info("%s: its images do not tell its turn much better", bone)
            return found
        apart = _between(found.transform, transform, self._middle(bone))
        if self._is_far(bone, found, apart):
            return replace(found, covariance=found.covariance + np.outer(apart, apart))
        slid = _slid(pair, distance < 0.0, transform)
        turned = replace(turned, covariance=turned.covariance + np.outer(slid, slid))
        alike = pair.correlation(transform)
        if alike < ALIKE:
            turned = replace(turned, covariance=larger(found.covariance, turned.covariance))
        LOG.info(
            "%s: turned by %.2f deg by the images, correlation %.2f; its own voxels differ by %.2f deg",
            *(bone, np.degrees(np.linalg.norm(apart[:3])), alike, np.degrees(np.linalg.norm(slid))),
        )
        return turned

    def placed_together(self, found: Mapping[str, Registration]) -> dict[str, Registration]:
        """Registrations in which intensities place the bones whose images are of unlike contrast.

        Parameters
        ----------
        found : mapping of str to Registration
            Registrations of a pose's bones, refined one by one or not.

        Returns
        -------
        dict of str to Registration
            The transforms with their covariances. A bone keeps its registration where its turn is known to
            half a degree, where its images are alike, and where they tell its turn less well; every
            bone does where there are fewer than eight. A
            bone keeps its transform where the images place it farther away than its deviations explain; then
            its covariance holds the difference.
        """
        open_ones = {bone: one for bone, one in found.items() if one.rotation_deviation >= KNOWN}
        regions = self._compared(open_ones)
        alike = {bone: region.correlation(found[bone].transform) for bone, region in regions.items()}
        unlike = [bone for bone, correlation in alike.items() if correlation < ALIKE]
        if not unlike:
            return dict(found)
        regions |= self._compared({bone: one for bone, one in found.items() if bone not in open_ones})
        count = sum(len(region.points) for region in regions.values())
        if len(regions) < FEWEST_BONES:
            LOG.info("%d bones are too few to tell how the images' intensities go together", len(regions))
            return dict(found)
        if count < ENOUGH:
            LOG.warning("too few voxels of bones (%d) to tell how the images' intensities go together", count)
            return dict(found)
        placed = place_together(regions, {bone: found[bone].transform for bone in regions}, unlike)
        return {b: self._chosen(b, one, *placed[b]) if b in placed else one for b, one in found.items()}

    def _chosen(
        self, bone: str, found: Registration, transform: RigidTransform, covariance: Array | None
    ) -> Registration:
        """The registration by intensities, or that before."""
        if covariance is None:
            LOG.info("%s: the images' intensities do not tell its place", bone)
            return found
        by_images = replace(found, transform=transform, covariance=covariance)
        if by_images.rotation_deviation > found.rotation_deviation:
            LOG.info("%s: the images' intensities do not tell its turn better", bone)
            return found
        apart = _between(found.transform, transform, self._middle(bone))
        if self._is_far(bone, found, apart):
            return replace(found, covariance=found.covariance + np.outer(apart, apart))
        LOG.info(
            "%s: placed by %.2f deg and %.2f mm by what the intensities of all bones have in common",
            *(bone, np.degrees(np.linalg.norm(apart[:3])), np.linalg.norm(apart[3:])),
        )
        return by_images

    def _is_far(self, bone: str, found: Registration, apart: Array) -> bool:
        """Whether the images move a bone (6,) by more than its surfaces' deviations explain."""
        limit = np.maximum(
            FARTHEST * np.array([np.radians(found.rotation_deviation), found.translation_deviation]),
            LEAST_FARTHEST * [1, self.neutral.spacing.max()],
        )
        turn, shift = (float(np.linalg.norm(part)) for part in (apart[:3], apart[3:]))
        far = bool(turn > limit[0] or shift > limit[1])
        if far:
            LOG.warning(
                "%s: images place it %.1f deg and %.2f mm from where its surfaces do, which is kept",
                *(bone, np.degrees(turn), shift),
            )
        return far

    def _compared(self, found: Mapping[str, Registration]) -> dict[str, Region]:
        """Voxels of the bones that have enough of them, an even share of those of a large bone."""
        compared = {}
        for bone, one in found.items():
            crop, distance = self._region(bone)
            region = np.isfinite(distance)
            if np.count_nonzero(region) < FEWEST:
                continue
            middle = self._middle(bone)
            pair = _Pair.build(crop, region, self.target, [one.transform], middle)
            voxels = np.argwhere(region)
            voxels = voxels[evenly(len(voxels), MOST)]
            values = crop.values[tuple(voxels.T)].astype(float)
            compared[bone] = Region(crop.to_world(voxels), values, pair.splines, middle)
        return compared

    def _middle(self, bone: str) -> Array:
        return np.asarray(self.bones[bone].vertices.mean(axis=0), float)

    def _region(self, bone: str) -> tuple[Volume, Array]:
        """The neutral image around a bone, and its voxels' distances from it in mm.

        They are negative within the bone, and infinite far from it and where another bone is.
        """
        corners = self.neutral.to_index(_corners(self.bones[bone].vertices))
        margin = int(AROUND) + RIM
        lower = np.maximum(np.floor(corners.min(axis=0)).astype(int) - margin, 0)
        upper = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + margin + 1, self.neutral.shape)
        crop = self.neutral.crop(lower, upper)
        points = crop.to_world(np.indices(crop.shape).reshape(3, -1).T)
        distance = Distance(self.bones[bone]).signed(points)[0]
        distance[distance >= AROUND * crop.spacing.min()] = np.inf
        for name, other in self.bones.items():
            near = np.flatnonzero(np.isfinite(distance))
            if name != bone and _near(other.vertices, points[near]):
                distance[near[Distance(other).signed(points[near])[0] <= 0]] = np.inf
        return crop, distance.reshape(crop.shape)


@dataclass(frozen=True)
class _Pair:
    """The neutral image's region of one bone and the other image around its place, as splines.

    Parameters
    ----------
    neutral : Volume
        Image around the neutral bone.
    region : array (nx, ny, nz) of bool
        The voxels that are compared.
    splines : Volume
        Coefficients of cubic splines of the other image.
    middle : array (3,)
        Centre of the small motions, mm.
    """

    neutral: Volume
    region: BoolArray
    splines: Volume
    middle: Array

    @staticmethod
    def build(
        neutral: Volume, region: BoolArray, target: Volume, starts: Sequence[RigidTransform], middle: Array
    ) -> _Pair:
        """The pair for a search from each of the starts."""
        grid = neutral.to_world(np.array(list(product(*((0, n - 1) for n in neutral.shape)))))
        there = target.to_index(np.concatenate([start(grid) for start in starts]))
        lower = np.maximum(np.floor(there.min(axis=0)).astype(int) - RIM, 0)
        upper = np.maximum(np.ceil(there.max(axis=0)).astype(int) + RIM, lower + 1)
        crop = target.crop(lower, upper)
        splines = ndimage.spline_filter(crop.values.astype(float))
        return _Pair(neutral, region, Volume(splines, crop.affine), middle)

    def warped(self, transform: RigidTransform) -> Array:
        """The other image (nx, ny, nz) on the neutral image's voxels."""
        grid = self.neutral.to_world(np.indices(self.neutral.shape).reshape(3, -1).T)
        index = self.splines.to_index(transform(grid)).T
        values = ndimage.map_coordinates(self.splines.values, index, prefilter=False, mode="nearest")
        return np.asarray(values).reshape(self.neutral.shape)

    def aligned(self, transform: RigidTransform) -> tuple[RigidTransform, Array]:
        """The motion of least squared differences of the edges' directions, and its covariance (6, 6)."""
        points = self.neutral.to_world(np.argwhere(self.region))
        known = edge_directions(self.neutral.values.astype(float))[:, self.region]
        for _ in range(ITERATIONS):
            rows = self._rows(transform, points, known)
            weights = robust_weights(rows.distance)
            step = solve(rows, weights)
            transform = moved(transform, step, self.middle)
            if np.abs(step).max() < STILL:
                break
        normal = (rows.jacobian * weights[:, None]).T @ rows.jacobian
        places = np.tile(points, (len(known), 1))
        spread = patch_covariance(rows, weights, places, np.asarray(np.linalg.inv(normal), float))
        return transform, SPREAD**2 * spread

    def _rows(self, transform: RigidTransform, points: Array, known: Array) -> Rows:
        """What small motions change in the edges' directions, and what is missing to those known."""
        found = edge_directions(self.warped(transform))
        slopes = np.stack([np.stack(np.gradient(part), axis=-1)[self.region] for part in found])
        by_world = slopes @ np.linalg.inv(self.neutral.affine[:3, :3]) @ transform.rotation.T
        arms = transform(points) - transform(self.middle)
        jacobian = np.concatenate([np.cross(arms[None], by_world), by_world], axis=-1)
        return Rows(jacobian.reshape(-1, 6), (known - found[:, self.region]).ravel())

    def related(self, transform: RigidTransform) -> float:
        """Cosine between the edges' directions of both images, from about 1/3 for unrelated ones to 1."""
        one, other = (
            edge_directions(values)[:, self.region]
            for values in (self.neutral.values.astype(float), self.warped(transform))
        )
        return float((one * other).sum() / np.sqrt((one**2).sum() * (other**2).sum()))

    def correlation(self, transform: RigidTransform) -> float:
        """Correlation of both images' intensities in the region."""
        return float(np.corrcoef(self.neutral.values[self.region], self.warped(transform)[self.region])[0, 1])


def _slid(pair: _Pair, bone: BoolArray, transform: RigidTransform) -> Array:
    """How the bone's own voxels turn it (6,) beyond a transform found with the tissue on it.

    Zero where they are too few to tell.
    """
    if np.count_nonzero(bone) < FEWEST:
        return np.zeros(6)
    alone, _ = replace(pair, region=bone).aligned(transform)
    return np.append(_between(transform, alone, pair.middle)[:3], np.zeros(3))


def _turned(found: Registration, by_images: RigidTransform, covariance: Array, middle: Array) -> Registration:
    """The registration turned about its middle as images say; they may shift fat and distort places."""
    turn = np.append(_between(found.transform, by_images, middle)[:3], np.zeros(3))
    both = block_diag(covariance[:3, :3], found.covariance[3:, 3:])
    return replace(found, transform=moved(found.transform, turn, middle), covariance=both)


def _between(first: RigidTransform, second: RigidTransform, middle: Array) -> Array:
    """The small motion (6,), as `moved` takes it, from one transform to another."""
    turn = Rotation.from_matrix(second.rotation @ first.rotation.T).as_rotvec()
    return np.concatenate([turn, second(middle) - first(middle)])


def _corners(points: Array) -> Array:
    """Corners (8, 3) of the points' box."""
    return np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))


def _near(points: Array, others: Array) -> bool:
    """Whether the boxes of two sets of points overlap."""
    low, high = points.min(axis=0), points.max(axis=0)
    return len(others) > 0 and bool(((others.min(axis=0) <= high) & (others.max(axis=0) >= low)).all())
