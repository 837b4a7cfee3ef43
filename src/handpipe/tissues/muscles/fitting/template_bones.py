"""Affine maps of a template's bones onto the subject's (Wang 2021 §6.1)."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.mesh.surfaces import Distance, Surface, sample_points

log = logging.getLogger(__name__)

SAMPLES = 250  # points a bone that steer its map
NEARLY = 1.25  # times the error of the best similarity: one that fits nearly as well
TURNED = np.radians(20.0)  # rad, between similarities that differ
OPPOSED = np.radians(75.0)  # rad, between starts of which one alone can be right
DISTINCT = 1.25  # times the error of the best maps: a turn that the shapes of bones exclude
FINER = (22.5, 11.25)  # deg, of turns between the starts
CLEARLY = 0.7  # of the error of the maps from the best similarity: a reason to leave it
VOLUMES = (0.2, 5.0)  # times a template's volume: a bone's map beyond is wrong
SIMILARITIES, AFFINITIES = 20, 20  # iterations of closest points, by each kind of map


@dataclass(frozen=True)
class Affine:
    """The affine map X -> matrix @ X + offset.

    Parameters
    ----------
    matrix : array (3, 3)
        Linear part.
    offset : array (3,)
        Translation in mm.
    """

    matrix: Array
    offset: Array

    def __call__(self, points: Array) -> Array:
        """Images of points (3,) or (n, 3) in mm, of the same shape."""
        return points @ self.matrix.T + self.offset


@dataclass(frozen=True)
class Rival:
    """Maps of all template bones that are turned against the chosen ones, and that fit nearly as well.

    Parameters
    ----------
    error : float
        Mean distance in mm that the chosen maps leave.
    turned : float
        The same of the other maps.
    turn : float
        Angle in deg between them.
    """

    error: float
    turned: float
    turn: float


def register_bones(
    templates: Mapping[str, Surface], bones: Mapping[str, Surface]
) -> tuple[dict[str, Affine], Rival | None]:
    """Affine maps of template bones onto the subject's bones of the same names.

    Similarities of all bones together start each bone's own iterative closest points: rigid with one scale
    first, then affine. One similarity tells right from left and front from back where bones lie side by side.
    The bones of one finger lie in a line: similarities that are turned about it fit nearly as well. There the
    bones' own shapes decide, after each has been registered. If they do not exclude a turn, it is a rival.
    """
    starts = _similarities(templates, bones)
    if len(starts) == 1:
        return _registered(templates, bones, starts[0]), None
    found = [_Turned.register(templates, bones, start) for start in starts]
    log.info("template bones turned about their line: %s mm", np.round([f.error for f in found], 2))
    best = min(found, key=lambda f: f.error)
    best = best if best.error < CLEARLY * found[0].error else found[0]
    others = [f for f in found if _angle_between(f.start, best.start) > OPPOSED]
    other = min(others, key=lambda f: f.error, default=None)
    rival = None
    if other and other.error < DISTINCT * best.error:
        report = "template bones: %.2f mm, and %.2f mm turned by %.0f deg: check where muscles lie"
        rival = Rival(best.error, other.error, float(np.degrees(_angle_between(other.start, best.start))))
        log.warning(report, rival.error, rival.turned, rival.turn)
    return (best if best is found[0] else _refined(templates, bones, best)).maps, rival


def _refined(templates: Mapping[str, Surface], bones: Mapping[str, Surface], best: _Turned) -> _Turned:
    """The best of finer turns about the line of the bones."""
    centres = np.array([bones[n].centroid() for n in templates])
    # One bone has a long axis of its own; several lie in a line.
    line = _long_axis(centres if len(centres) > 1 else next(iter(bones.values())).vertices)
    middle = centres.mean(axis=0)
    for angle in FINER:
        starts = [_turned(best.start, sign * angle, line, middle) for sign in (-1.0, 1.0)]
        best = min([best, *(_Turned.register(templates, bones, s) for s in starts)], key=lambda f: f.error)
    return best


@dataclass(frozen=True)
class _Turned:
    """Maps of all bones from one start, and the distance in mm that they leave."""

    start: Affine
    maps: dict[str, Affine]
    error: float

    @staticmethod
    def register(templates: Mapping[str, Surface], bones: Mapping[str, Surface], start: Affine) -> _Turned:
        maps = _registered(templates, bones, start)
        return _Turned(start, maps, _misfit(templates, bones, maps))


def _turned(start: Affine, angle: float, axis: Array, middle: Array) -> Affine:
    """A similarity turned by `angle` degrees about an axis through `middle`."""
    turn = Rotation.from_rotvec(np.radians(angle) * axis).as_matrix()
    return Affine(turn @ start.matrix, turn @ (start.offset - middle) + middle)


def _registered(
    templates: Mapping[str, Surface], bones: Mapping[str, Surface], start: Affine
) -> dict[str, Affine]:
    return {name: _register(templates[name], bones[name], start) for name in templates}


def _misfit(
    templates: Mapping[str, Surface], bones: Mapping[str, Surface], maps: Mapping[str, Affine]
) -> float:
    """Mean over bones of the distance in mm (rms, both ways) that their own maps leave."""
    errors = []
    for name, to_bone in maps.items():
        moved = templates[name].moved(to_bone(templates[name].vertices))
        forth = Distance(bones[name]).closest(sample_points(moved, 2 * SAMPLES, seed=5))[0]
        back = Distance(moved).closest(sample_points(bones[name], 2 * SAMPLES, seed=6))[0]
        errors.append(np.sqrt(np.mean(np.concatenate([forth, back]) ** 2)))
    return float(np.mean(errors))


def _angle_between(a: Affine, b: Affine) -> float:
    """Angle in rad of the rotation from one similarity to the other."""
    turns = [s.matrix / np.cbrt(np.linalg.det(s.matrix)) for s in (a, b)]
    return float(Rotation.from_matrix(turns[0].T @ turns[1]).magnitude())


def _similarities(templates: Mapping[str, Surface], bones: Mapping[str, Surface]) -> list[Affine]:
    """Similarities from centroids, refined by closest points of all bones.

    The best comes first, then those that fit nearly as well and are turned against each one before.
    """
    source = np.concatenate([sample_points(s, SAMPLES, seed=1) for s in templates.values()])
    own = np.repeat(np.arange(len(templates)), SAMPLES)
    targets = [Distance(bones[name]) for name in templates]
    centres = (
        np.array([s.centroid() for s in templates.values()]),
        np.array([bones[n].centroid() for n in templates]),
    )
    starts = [
        _start(source, centres, np.vstack([b.vertices for b in bones.values()]), angle)
        for angle in range(0, 360, 45)
    ]
    found: list[tuple[float, Affine]] = []
    for start in starts:
        guess = start
        for _ in range(12):
            guess = fit_similarity(source, _closest(targets, own, guess(source)))
        moved = guess(source)
        error = float(np.sqrt(((moved - _closest(targets, own, moved)) ** 2).sum(axis=1).mean()))
        found.append((error, guess))
    found.sort(key=lambda pair: pair[0])
    log.info("template bones: %.2f mm after one similarity", found[0][0])
    chosen: list[Affine] = []
    for error, guess in found:
        turned = all(_angle_between(guess, other) > TURNED for other in chosen)
        if error <= NEARLY * found[0][0] and turned:
            chosen.append(guess)
    return chosen


def _start(source: Array, centres: tuple[Array, Array], target: Array, angle: float) -> Affine:
    """Similarity that matches the bones' centroids, turned by `angle` degrees about their long axis."""
    a, b = centres
    if len(a) == 1:  # one bone: its own long axis, towards the same end of the frame
        ends = [_long_axis(source), _long_axis(target)]
        a, b = (np.vstack([c, c + e]) for c, e in zip(centres, ends, strict=True))
    guess = fit_similarity(a, b)
    return _turned(guess, angle, _long_axis(b), b.mean(axis=0))


def _long_axis(points: Array) -> Array:
    """Unit direction of greatest spread, towards the frame's positive octant."""
    centred = points - points.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    return axis * np.sign(axis[np.argmax(np.abs(axis))])


def _closest(targets: list[Distance], own: IntArray, points: Array) -> Array:
    out = np.empty_like(points)
    for i, target in enumerate(targets):
        out[own == i] = target.closest(points[own == i])[2]
    return out


def fit_similarity(source: Array, target: Array) -> Affine:
    """The best rotation, scale and translation of points onto points, in the sense of least squares.

    Parameters
    ----------
    source, target : array (n, 3)
        Corresponding points in mm.

    Returns
    -------
    Affine
        Map from source to target.

    References
    ----------
    Umeyama 1991.
    """
    a, b = source.mean(axis=0), target.mean(axis=0)
    u, s, vt = np.linalg.svd((target - b).T @ (source - a))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    matrix = (u * signs) @ vt * (signs @ s) / ((source - a) ** 2).sum()
    return Affine(matrix, b - matrix @ a)


def _register(template: Surface, bone: Surface, start: Affine) -> Affine:
    """Closest points both ways: those of the bone keep an affine map from shrinking into it."""
    source, back = sample_points(template, 2 * SAMPLES, seed=2), sample_points(bone, 2 * SAMPLES, seed=3)
    target = Distance(bone)
    guess = start
    for iteration in range(SIMILARITIES + AFFINITIES):
        forth = target.closest(guess(source))[2]
        moved = template.moved(guess(template.vertices))
        _, triangles, at = Distance(moved).closest(back)
        inverse = np.linalg.inv(guess.matrix)
        origins = (at - guess.offset) @ inverse.T
        a, b = np.vstack([source, origins]), np.vstack([forth, back])
        guess = fit_similarity(a, b) if iteration < SIMILARITIES else _fit_affine(a, b)
    if not VOLUMES[0] < np.linalg.det(guess.matrix) < VOLUMES[1]:
        raise ConvergenceError(
            "Template bone", f"its volume would change by {np.linalg.det(guess.matrix):.2f}"
        )
    return guess


def _fit_affine(source: Array, target: Array) -> Affine:
    homogeneous = np.column_stack([source, np.ones(len(source))])
    solution = np.linalg.lstsq(homogeneous, target, rcond=None)[0]
    return Affine(np.asarray(solution[:3].T, float), np.asarray(solution[3], float))
