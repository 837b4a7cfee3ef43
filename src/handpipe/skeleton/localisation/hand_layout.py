"""Where a template hand lies in an image, by its metacarpals among bright solids: a similarity.

Two metacarpals of the template and two solids of like proportions give a similarity each way round. The one
under which most bones near the root have a solid in their place is the hand's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.localisation.bright_solids import BrightSolid, SolidShape

SCALES = (0.6, 1.5)  # of the template: from a child's hand to the largest
ALIKE = 0.18  # logarithm of the ratio of two bones' scales
PLUMP = 0.5  # the same of their proportions, width by length
PLACED = 12.0  # mm, at the template's scale, within which a solid is in a bone's place
RESIDUAL = 5.0  # mm, at the template's scale, of two bones' ends
MOST = 80  # solids that are tried
ROUNDS = 4  # in which the similarity is fitted to all bones that have a solid in their place


@dataclass(frozen=True)
class Similarity:
    """A rotation, scale and translation: x -> scale rotation x + translation, in mm."""

    rotation: Array
    scale: float
    translation: Array

    def __call__(self, points: Array) -> Array:
        """The moved points (..., 3)."""
        return np.asarray(self.scale * points @ self.rotation.T + self.translation)

    @staticmethod
    def fit(source: Array, target: Array) -> Similarity:
        """The best in least squares from points (n, 3) to points (n, 3) (Umeyama 1991), never a mirror."""
        a, b = source - source.mean(axis=0), target - target.mean(axis=0)
        u, d, vt = np.linalg.svd(b.T @ a)
        sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
        rotation = (u * sign) @ vt
        scale = float((d * sign).sum() / max((a**2).sum(), 1e-12))
        return Similarity(rotation, scale, target.mean(axis=0) - scale * rotation @ source.mean(axis=0))


@dataclass(frozen=True)
class Placed:
    """A similarity, how many bones have solids in their place under it, and which they are.

    Parameters
    ----------
    similarity : Similarity
        From the template to the image.
    score : float
        Sum over the bones of one for a solid in its place, down to zero for one `PLACED` off.
    solids : dict of str to tuple
        Number of each bone's solid, and whether its ends are exchanged.
    """

    similarity: Similarity
    score: float
    solids: dict[str, tuple[int, bool]]


def layouts(
    template: Mapping[str, SolidShape], seeds: Sequence[str], solids: Sequence[BrightSolid]
) -> list[Placed]:
    """Ways in which a template hand may lie in an image, the likeliest first.

    Parameters
    ----------
    template : mapping of str to SolidShape
        The template's bones that keep their places among one another: those at the root and next to it.
    seeds : sequence of str
        Of these, the long bones of which pairs give trials.
    solids : sequence of BrightSolid
        Bright solids of the image.

    Returns
    -------
    list of Placed
        Of each way to name the solids the best; none where no two bones fit.
    """
    long = [i for i, s in enumerate(solids) if s.shape.slim][:MOST]
    ends = np.array([solids[i].shape.ends for i in long]).reshape(-1, 2, 3)
    slim = {b: s for b, s in template.items() if s.slim}
    found: dict[tuple[tuple[str, int], ...], Placed] = {}
    for trial in _trials(template, seeds, [solids[i].shape for i in long]):
        placed = _settled(slim, trial, ends, long)
        key = tuple(sorted((bone, number) for bone, (number, _) in placed.solids.items()))
        if key and (key not in found or placed.score > found[key].score):
            found[key] = placed
    return sorted(found.values(), key=lambda p: -p.score)


def _trials(
    template: Mapping[str, SolidShape], seeds: Sequence[str], shapes: Sequence[SolidShape]
) -> Iterator[Similarity]:
    """Similarities of pairs of bones and pairs of solids of like lengths, either way round."""
    lengths, widths = (np.array([getattr(s, size) for s in shapes]) for size in ("length", "width"))
    fits = {}
    for bone in seeds:
        own = template[bone]
        scale = lengths / own.length
        plump = np.abs(np.log((widths / lengths) / (own.width / own.length)))
        fits[bone] = np.flatnonzero((scale > SCALES[0]) & (scale < SCALES[1]) & (plump < PLUMP))
    for first, second in combinations(seeds, 2):
        source = np.concatenate([template[first].ends, template[second].ends])
        for i, j in product(fits[first].tolist(), fits[second].tolist()):
            ratio = (lengths[i] / template[first].length) / (lengths[j] / template[second].length)
            if i == j or abs(np.log(ratio)) > ALIKE:
                continue
            for a, b in product((1, -1), repeat=2):
                target = np.concatenate([shapes[i].ends[::a], shapes[j].ends[::b]])
                trial = Similarity.fit(source, target)
                off = np.linalg.norm(trial(source) - target, axis=1).max()
                if SCALES[0] < trial.scale < SCALES[1] and off < RESIDUAL * trial.scale:
                    yield trial


def _settled(
    template: Mapping[str, SolidShape], trial: Similarity, ends: Array, long: Sequence[int]
) -> Placed:
    """The similarity fitted to all bones that have a solid in their place."""
    bones = [*template]
    source = np.array([template[bone].ends for bone in bones])
    for _ in range(ROUNDS):
        off, number, turned = _nearest(trial(source), ends)
        near = off < PLACED * trial.scale
        if near.sum() < 2:
            break
        target = np.where(turned[:, None, None], ends[number][:, ::-1], ends[number])
        trial = Similarity.fit(source[near].reshape(-1, 3), target[near].reshape(-1, 3))
    off, number, turned = _nearest(trial(source), ends)
    worth = np.maximum(1 - off / (PLACED * trial.scale), 0)
    solids: dict[str, tuple[int, bool]] = {}
    score = 0.0
    for k in np.argsort(-worth):
        if worth[k] > 0 and long[number[k]] not in {n for n, _ in solids.values()}:
            solids[bones[k]] = long[number[k]], bool(turned[k])
            score += float(worth[k])
    return Placed(trial, score, solids)


def _nearest(places: Array, ends: Array) -> tuple[Array, Array, Array]:
    """Of each bone's ends (k, 2, 3): how far off the nearest solid's are, its number, whether exchanged."""
    apart = np.linalg.norm(places[:, None, :, None] - ends[None, :, None], axis=-1)  # (k, n, 2, 2)
    straight = np.maximum(apart[..., 0, 0], apart[..., 1, 1])
    crossed = np.maximum(apart[..., 0, 1], apart[..., 1, 0])
    off = np.minimum(straight, crossed)
    number = off.argmin(axis=1)
    rows = np.arange(len(places))
    return off[rows, number], number, crossed[rows, number] < straight[rows, number]
