"""Rigid registration of a neutral marrow surface to the same bone in another pose (Wang 2019, section 3.1).

Iterated closest points with distances to tangent planes, from many starts. Either surface may have parts that
the other lacks: a bone cut off by the image, or grown together with its neighbour. The result has a
covariance, and a doubt if the surfaces do not match or another place fits as well and images do not choose.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, ConvergenceError, RigidTransform
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface, sample_points
from handpipe.skeleton.bones.registration_result import Registration, rotation_uncertainty
from handpipe.skeleton.registration.edge_refinement import refine_to_edges
from handpipe.skeleton.registration.normal_equations import (
    FINEST,
    Rows,
    alike,
    covariance,
    moved,
    robust_weights,
    solve,
)
from handpipe.skeleton.registration.starts import principal_starts, uniform_starts

LOG = logging.getLogger(__name__)

COARSE, FINE, VERTICES = 300, 1500, 6000  # points in the stages
KEPT = 0.9  # share of the smaller surface that is expected to lie on the larger one
SURPLUS = 1.2  # ratio of areas above which the target holds more than the bone
POOR = 0.01  # residual by the bone's size above which starts of all directions are tried, too
WORST = 0.05  # the same, beyond which the surfaces are of different bones
STILL = 1e-5  # rad, and mm per mm of the bone's size
PROMISING = 20  # of many starts, those that a few steps bring nearest
RIVALS = 4  # places that are followed to the end
NEARLY = 1.5  # times the least residual, up to which images may choose another place
APART = np.radians(15.0)  # turns closer than this are one place
MATCHED = 0.3  # mm; and five times the residual
LEAST_COVERED, LEAST_EXPLAINED = 0.45, 0.4  # shares of the two surfaces below which a warning is due
CERTAIN, OUTLYING = 5.0, 5.0  # standard deviations by which a rival has to fit worse; of an outlier
ROUGH_ROUNDS, COARSE_ROUNDS, FINE_ROUNDS = 5, 15, 24  # of closest points, in the stages
LAST_ROUNDS = 40  # at most


@dataclass(frozen=True)
class _Pair:
    """The two surfaces ready for closest-point queries.

    Parameters
    ----------
    neutral, target : Distance
        Distances to the surfaces.
    middle : array (3,)
        Mean of the neutral surface's vertices in mm.
    size : float
        Square root of the neutral surface's area in mm.
    ratio : float
        Area of the target over that of the neutral surface.
    """

    neutral: Distance
    target: Distance
    middle: Array
    size: float
    ratio: float

    @staticmethod
    def build(neutral: Surface, target: Surface) -> _Pair:
        area = neutral.area()
        middle = neutral.vertices.mean(axis=0)
        return _Pair(Distance(neutral), Distance(target), middle, float(np.sqrt(area)), target.area() / area)

    @property
    def surplus(self) -> bool:
        """Whether the target holds more than the bone, so that the neutral's points have to lead."""
        return self.ratio > SURPLUS

    def target_rows(self, transform: RigidTransform, points: Array) -> Rows:
        """Distances of target points from the moved neutral surface."""
        distance, _, closest, normals = self.neutral.signed(transform.inverse()(points))
        return Rows.build(
            transform(closest), normals @ transform.rotation.T, distance, transform(self.middle)
        )

    def neutral_rows(self, transform: RigidTransform, points: Array) -> Rows:
        """Distances of moved neutral points from the target surface."""
        moved = transform(points)
        distance, _, _, normals = self.target.signed(moved)
        return Rows.build(moved, normals, -distance, transform(self.middle))

    @property
    def leading(self) -> Surface:
        """The surface of which all is expected on the other."""
        return self.neutral.surface if self.surplus else self.target.surface

    def leading_rows(self, transform: RigidTransform, points: Array) -> Rows:
        """Distances of points of the leading surface from the other one."""
        return (self.neutral_rows if self.surplus else self.target_rows)(transform, points)

    def score(self, transform: RigidTransform, target: Array, neutral: Array) -> float:
        """Mean square in mm^2 of both surfaces' distances, without what one of them may lack."""
        a = self.target_rows(transform, target).distance
        b = self.neutral_rows(transform, neutral).distance
        return _trimmed(a, KEPT * min(1.0, 1 / self.ratio)) + _trimmed(b, KEPT * min(1.0, self.ratio))


def register(
    neutral_marrow: Surface,
    target_marrow: Surface,
    *,
    volume: Volume | None = None,
    start: RigidTransform | Sequence[RigidTransform] | None = None,
    choose: Callable[[Sequence[Registration]], int | None] | None = None,
) -> Registration:
    """Rigid transform that carries the neutral surface onto the target, of least residual over all starts.

    A target that lacks a part of the bone, or holds more than the bone, is registered by what both have.
    Where places far apart leave nearly the same residual, what else is known may choose one.

    Parameters
    ----------
    neutral_marrow, target_marrow : Surface
        Marrow surfaces of one bone in neutral and in a pose, mm.
    volume : Volume, optional
        Image of the pose. With it, the result is refined to the image's edge between bright marrow and dark
        shell.
    start : RigidTransform or sequence of RigidTransform, optional
        Initial guesses, such as the parent's transform; the principal axes give more.
    choose : callable, optional
        Chooses one of several places by its number, or None if it cannot tell; that of least residual comes
        first.

    Returns
    -------
    Registration
        The transform; its `doubt` says why it may be wrong.

    Raises
    ------
    ConvergenceError
        If the surfaces do not fit one another at all.
    """
    pair = _Pair.build(neutral_marrow, target_marrow)
    guesses = [start] if isinstance(start, RigidTransform) else list(start or [])
    rivals = _rivals(pair, [*guesses, *principal_starts(neutral_marrow, target_marrow)])
    if np.sqrt(rivals[0][0]) > POOR * pair.size:
        more = _rivals(pair, uniform_starts(neutral_marrow, target_marrow))
        rivals = _distinct(_sorted([*rivals, *more]))
    found = _finish(pair, rivals[0][1])
    if not np.isfinite(found.rms) or found.rms > WORST * pair.size:
        raise ConvergenceError(
            "Registration", f"residual {found.rms:.2f} mm at a bone of size {pair.size:.1f} mm"
        )
    within = NEARLY**2 * rivals[0][0] if choose is not None else 0.0
    near = [place for score, place in rivals[1:] if score < within]
    places = [found, *(_finish(pair, place) for place in near)]
    chosen = choose(places) if choose is not None and near else None
    found = places[chosen or 0]
    rejected = 0 if chosen is None else len(near)
    found = replace(found, doubt=_doubt(found) or _rival_doubt(pair, found, rivals[1 + rejected :]))
    LOG.info(
        "registered: rms %.3f mm, uncertainty %s deg, %.0f %% covered%s",
        found.rms,
        np.round(rotation_uncertainty(found), 2),
        100 * found.covered,
        f"; in doubt: {found.doubt}" if found.doubt else "",
    )
    return found if volume is None else refine_to_edges(neutral_marrow, volume, found)


Scored = tuple[float, RigidTransform]


def _sorted(scored: Sequence[Scored]) -> list[Scored]:
    return sorted(scored, key=lambda s: s[0])


def _rivals(pair: _Pair, starts: Sequence[RigidTransform]) -> list[Scored]:
    """The places to which the starts lead, apart from one another, those of least score first."""
    rough = starts
    if len(starts) > PROMISING:
        rough = [t for _, t in _brought(pair, starts, COARSE // 2, iterations=ROUGH_ROUNDS)[:PROMISING]]
    coarse = _brought(pair, rough, COARSE, iterations=COARSE_ROUNDS)
    fine = _brought(pair, [t for _, t in _distinct(coarse)[:RIVALS]], FINE, iterations=FINE_ROUNDS)
    return _distinct(fine)


def _distinct(scored: Sequence[Scored]) -> list[Scored]:
    """The best of those that are one place."""
    kept: list[Scored] = []
    for candidate in scored:
        if all(candidate[1].angle_to(other) > APART for _, other in kept):
            kept.append(candidate)
    return kept


def _brought(pair: _Pair, starts: Sequence[RigidTransform], count: int, iterations: int) -> list[Scored]:
    """The starts brought to the target, those of least score first."""
    target = sample_points(pair.target.surface, count, seed=1)
    neutral = sample_points(pair.neutral.surface, count, seed=2)
    ends = [_aligned(pair, start, target, neutral, iterations) for start in starts]
    return _sorted([(pair.score(end, target, neutral), end) for end in ends])


def _aligned(
    pair: _Pair, transform: RigidTransform, target: Array, neutral: Array, iterations: int
) -> RigidTransform:
    for i in range(iterations):
        # Both surfaces' points keep the one from covering only a part of the other; later on, a surface that
        # lacks a part must not be drawn towards where that part would be.
        rows = [pair.leading_rows(transform, neutral if pair.surplus else target)]
        if i < iterations // 2 and not pair.surplus:
            rows.append(pair.neutral_rows(transform, neutral))
        step = solve(Rows.joined(rows), np.concatenate([robust_weights(r.distance) for r in rows]))
        transform = moved(transform, step, pair.middle)
        if i >= iterations // 2 and _is_still(step, pair):
            break
    return transform


def _finish(pair: _Pair, transform: RigidTransform) -> Registration:
    """Last iterations on the leading surface's own vertices, whose noise gives the covariance."""
    leading = pair.leading.vertices
    points = leading[:: int(np.ceil(len(leading) / VERTICES))]
    for _ in range(LAST_ROUNDS):
        rows = pair.leading_rows(transform, points)
        step = solve(rows, robust_weights(rows.distance))
        transform = moved(transform, step, pair.middle)
        if _is_still(step, pair):
            break
    every = pair.leading_rows(transform, leading)
    weights = robust_weights(every.distance)
    rms = float(np.sqrt((weights * every.distance**2).sum() / weights.sum()))
    near = max(MATCHED, 5 * rms)
    target = pair.target_rows(transform, sample_points(pair.target.surface, FINE, seed=1)).distance
    neutral = pair.neutral_rows(transform, sample_points(pair.neutral.surface, FINE, seed=2)).distance
    return Registration(
        transform,
        rms,
        covariance(every, weights, pair.leading.edges(), leading),
        covered=float((np.abs(neutral) < near).mean()),
        explained=float((np.abs(target) < near).mean()),
    )


def _doubt(found: Registration) -> str:
    """What the match itself says against a registration; empty if nothing."""
    if found.covered < LEAST_COVERED:
        return f"{100 * found.covered:.0f} % of the bone is covered"
    if found.explained < LEAST_EXPLAINED:
        return f"{100 * (1 - found.explained):.0f} % of what was segmented is not the bone"
    return ""


def _rival_doubt(pair: _Pair, found: Registration, rivals: Sequence[Scored]) -> str:
    """Whether another place fits nearly as well: its residuals exceed the best one's by no more than noise.

    Twice the logarithm of the likelihoods' ratio, outliers capped, over as many independent vertices as the
    covariance takes them for.
    """
    leading = pair.leading.vertices
    best = pair.leading_rows(found.transform, leading).distance
    robust = best * np.sqrt(robust_weights(best))
    deviation = max(found.rms, FINEST)
    independent = len(best) / alike(robust, pair.leading.edges())
    for _, rival in rivals:
        other = pair.leading_rows(rival, leading).distance
        excess = _capped(other / deviation) - _capped(best / deviation)
        turn = np.degrees(rival.angle_to(found.transform))
        LOG.debug("turned by %.0f deg: likelihood ratio 2 log %.1f", turn, independent * excess)
        if independent * excess < CERTAIN**2:
            return f"it fits nearly as well turned by {turn:.0f} deg"
    return ""


def _capped(standardised: Array) -> float:
    return float(np.minimum(standardised**2, OUTLYING**2).mean())


def _is_still(step: Array, pair: _Pair) -> bool:
    return bool(np.abs(step[:3]).max() < STILL and np.abs(step[3:]).max() < STILL * pair.size)


def _trimmed(distances: Array, kept: float) -> float:
    squares = np.sort(distances**2)
    return float(squares[: max(1, int(kept * len(squares)))].mean())
