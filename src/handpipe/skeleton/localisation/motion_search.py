"""Search for the motion of a bone that agrees best with an image: many trials, coarse to fine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.imaging.volumes import Volume
from handpipe.skeleton.localisation.bone_probes import MovingBones, Probes

FEW = 110  # probes in the coarse images
UNKNOWN = 0.3  # contrast of a probe that lies beyond the image
CLOUD = 48  # trials around a candidate in a round
ROUNDS = 5  # of trials around the candidates
REACHES = (2.5, 1.8, 1.2, 0.8, 0.5)  # mm, deviation of the far end of a bone in each round
SHIFT = 0.6  # of a round's reach: deviation of the shifts


@dataclass(frozen=True)
class Motions:
    """Rigid motions, many at once.

    Parameters
    ----------
    rotations : array (h, 3, 3)
        Rotation matrices.
    translations : array (h, 3)
        Translations after the rotations, mm.
    """

    rotations: Array
    translations: Array

    def __len__(self) -> int:
        """Number h of motions."""
        return len(self.translations)

    def __getitem__(self, index: NDArray | slice) -> Motions:
        """The motions of an index array, a mask or a slice."""
        return Motions(self.rotations[index], self.translations[index])

    @staticmethod
    def stack(transforms: list[RigidTransform]) -> Motions:
        """The motions of a list of transforms, in its order; the list may be empty."""
        return Motions(
            np.array([t.rotation for t in transforms]).reshape(-1, 3, 3),
            np.array([t.translation for t in transforms]).reshape(-1, 3),
        )

    def transforms(self) -> list[RigidTransform]:
        """One transform per motion, in order."""
        return [RigidTransform(r, t) for r, t in zip(self.rotations, self.translations, strict=True)]

    @staticmethod
    def joined(parts: list[Motions]) -> Motions:
        """All motions of several sets."""
        return Motions(
            np.concatenate([p.rotations for p in parts]), np.concatenate([p.translations for p in parts])
        )

    def seen_from(self, turned: RigidTransform) -> Motions:
        """The same motions about axes that a transform has carried elsewhere: T M T^-1."""
        back = turned.inverse()
        carried = self.carried(turned)
        translations = carried.rotations @ back.translation + carried.translations
        return Motions(carried.rotations @ back.rotation, translations)

    def carried(self, parent: RigidTransform) -> Motions:
        """Motions of a child, its parent at rest, carried on by the parent's motion."""
        return Motions(
            parent.rotation @ self.rotations, self.translations @ parent.rotation.T + parent.translation
        )


def coarse_contrast(evidence: MarrowEvidence, probes: Probes, motions: Motions) -> Array:
    """How much brighter (h,) the inside of a moved marrow is than the darkest near its outside, in levels."""
    inside = _means(_mean_nearest, evidence.bright, probes.inner, motions, 1.0)
    return inside - _means(_mean_nearest, evidence.dark, probes.outer, motions, 1.0 - UNKNOWN)


def fine_contrast(evidence: MarrowEvidence, probes: Probes, motions: Motions) -> Array:
    """The same (h,) in the image itself, which forgives less than half a millimetre."""
    inside = _means(_mean_linear, evidence.fine, probes.inner, motions, 1.0)
    return inside - _means(_mean_linear, evidence.fine, probes.outer, motions, 1.0 - UNKNOWN)


def _means(
    sampled: Callable[..., Array], image: Volume, points: Array, motions: Motions, beyond: float
) -> Array:
    """Means (h,) of an image at moved points (n, 3), with a value for those beyond it."""
    index = np.linalg.inv(image.affine)
    rotations = np.ascontiguousarray(index[:3, :3] @ motions.rotations)
    translations = motions.translations @ index[:3, :3].T + index[:3, 3]
    return sampled(image.values, points, rotations, translations, beyond)


@njit(cache=True, fastmath=True)
def _mean_nearest(values, points, rotations, translations, beyond):  # type: ignore[no-untyped-def]
    """Mean (h,) of nearest values, at most one, at points moved into voxel indices."""
    out = np.zeros(len(rotations))
    nx, ny, nz = values.shape
    for h in range(len(rotations)):
        m, t = rotations[h], translations[h] + 0.5
        total = 0.0
        for p in range(len(points)):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            i = int(np.floor(m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + t[0]))
            j = int(np.floor(m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + t[1]))
            k = int(np.floor(m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + t[2]))
            if 0 <= i < nx and 0 <= j < ny and 0 <= k < nz:
                total += min(values[i, j, k], 1.0)
            else:
                total += beyond
        out[h] = total / len(points)
    return out


@njit(cache=True, fastmath=True)
def _mean_linear(values, points, rotations, translations, beyond):  # type: ignore[no-untyped-def]
    """Mean (h,) of trilinear values, at most one, at points moved into voxel indices."""
    out = np.zeros(len(rotations))
    nx, ny, nz = values.shape
    for h in range(len(rotations)):
        m, t = rotations[h], translations[h]
        total = 0.0
        for p in range(len(points)):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            u = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + t[0]
            v = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + t[1]
            w = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + t[2]
            if not (0 <= u <= nx - 1 and 0 <= v <= ny - 1 and 0 <= w <= nz - 1):
                total += beyond
                continue
            i, j, k = min(int(u), nx - 2), min(int(v), ny - 2), min(int(w), nz - 2)
            u, v, w = u - i, v - j, w - k
            low = (1 - u) * ((1 - v) * values[i, j, k] + v * values[i, j + 1, k])
            low += u * ((1 - v) * values[i + 1, j, k] + v * values[i + 1, j + 1, k])
            high = (1 - u) * ((1 - v) * values[i, j, k + 1] + v * values[i, j + 1, k + 1])
            high += u * ((1 - v) * values[i + 1, j, k + 1] + v * values[i + 1, j + 1, k + 1])
            total += min((1 - w) * low + w * high, 1.0)
        out[h] = total / len(points)
    return out


def best_distinct(body: MovingBones, motions: Motions, scores: Array, count: int, apart: float) -> IntArray:
    """Indices of the best motions of which no two put the body's points within `apart` mm (rms)."""
    points = body.probes.points[:24]
    order = np.argsort(-scores, kind="stable")[:600]
    placed = np.einsum("hij,pj->hpi", motions.rotations[order], points) + motions.translations[order][:, None]
    kept: list[int] = []
    for i in range(len(order)):
        gaps = ((placed[kept] - placed[i]) ** 2).sum(axis=2).mean(axis=1)
        if (gaps > apart**2).all():
            kept.append(i)
        if len(kept) == count:
            break
    return order[kept]


def improved(
    evidence: MarrowEvidence, body: MovingBones, motions: Motions, random: np.random.Generator
) -> Motions:
    """Each motion replaced by the best of random ones around it, in rounds of ever smaller reach.

    The first rounds look at the coarse images, the last at the image itself.
    """
    few = body.probes.first(FEW)
    for number, reach in enumerate(REACHES):
        contrast = coarse_contrast if number < 3 else fine_contrast
        trials = _cloud(body, motions, reach, random)
        scores = contrast(evidence, few, trials).reshape(len(motions), CLOUD)
        motions = trials[np.arange(len(motions)) * CLOUD + scores.argmax(axis=1)]
    return motions


def _cloud(body: MovingBones, motions: Motions, reach: float, random: np.random.Generator) -> Motions:
    """`CLOUD` motions (h CLOUD) around each, itself the first: turned about the body's middle, and moved."""
    shape = (len(motions), CLOUD, 3)
    turns = random.normal(0.0, reach / body.size, shape)
    shifts = random.normal(0.0, SHIFT * reach, shape)
    turns[:, 0], shifts[:, 0] = 0.0, 0.0
    turned = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(*shape, 3)
    rotations = turned @ motions.rotations[:, None]
    middles = motions.rotations @ body.middle + motions.translations
    translations = middles[:, None] + shifts - rotations @ body.middle
    return Motions(rotations.reshape(-1, 3, 3), translations.reshape(-1, 3))
