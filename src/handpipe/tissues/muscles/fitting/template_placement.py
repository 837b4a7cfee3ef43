"""A muscle's template carried to the subject by the bones that both have (Wang 2021 §6.1)."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from handpipe.core import Array, ConvergenceError, InputError, IntArray
from handpipe.imaging.volumes import likely_cause
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces import Biharmonic, Distance, Surface, component_labels, sample_points

log = logging.getLogger(__name__)

SAMPLES = 250  # points a bone that steer the warp
SMOOTHING = 0.5  # mm
ROUND = 0.85  # of V / A, half the radius of a long round body: 15 edges around it, which cut off 3 % of it
NEARLY = 1.25  # times the error of the best similarity: one that fits nearly as well
TURNED = np.radians(20.0)  # rad, between similarities that differ
OPPOSED = np.radians(75.0)  # rad, between starts of which one alone can be right
DISTINCT = 1.25  # times the error of the best maps: a turn that the shapes of bones exclude
FINER = (22.5, 11.25)  # deg, of turns between the starts
CLEARLY = 0.7  # of the error of the maps from the best similarity: a reason to leave it
NEAR = 0.75  # of a bone's size: what attaches to it is nearer
VERTEX_IDS = "Give {bone: [template vertex ids]}"  # the remedy for a malformed file of attachments
FINEST = 0.4  # of the edge length that is asked for
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


class BoneWarp:
    """A smooth map of the template's space that carries each template bone onto the subject's.

    Each bone's affine map leaves it a little off the subject's surface; points spread over the bones are
    corrected to the closest ones there, and biharmonic interpolation of all of them carries what lies between
    the bones.

    Parameters
    ----------
    templates : mapping of str to Surface
        Template bones.
    bones : mapping of str to Surface
        The subject's neutral bones of the same names, in mm.

    Raises
    ------
    ConvergenceError
        Where the affine map of a bone changes its volume by more than a factor of 5.
    """

    def __init__(self, templates: Mapping[str, Surface], bones: Mapping[str, Surface]) -> None:
        self.registered, self.rival = register_bones(templates, bones)
        source, target = [], []
        for name, affine in self.registered.items():
            points = sample_points(templates[name], SAMPLES, seed=4)
            moved = affine(points)
            source.append(points)
            target.append(Distance(bones[name]).closest(moved)[2])
        self.points = np.vstack(source), np.vstack(target)
        self._interpolate = through_points(*self.points)

    def __call__(self, points: Array) -> Array:
        """Template points (n, 3) in the subject's neutral frame."""
        return self._interpolate(points)

    def jacobian(self, points: Array) -> Array:
        """Derivatives (n, 3, 3) at template points (n, 3)."""
        return self._interpolate.jacobian(points)


def through_points(source: Array, target: Array) -> Biharmonic:
    """The map of a `BoneWarp` again, from its points.

    Parameters
    ----------
    source, target : array (n, 3)
        Points of the template bones, and where they lie on the subject's: `BoneWarp.points`, in mm.

    Returns
    -------
    Biharmonic
        From the template's frame to the subject's.
    """
    return Biharmonic(source, target, smoothing=SMOOTHING)


@dataclass(frozen=True)
class PlacedTemplate:
    """First guess of a body.

    Parameters
    ----------
    surface : Surface
        Surface in mm.
    attachments : dict of str to array (k,)
        Ids of the vertices that are attached to each bone.
    landmarks : dict of str to int
        Vertex of each label.
    """

    surface: Surface
    attachments: dict[str, IntArray]
    landmarks: dict[str, int] = field(default_factory=dict)


def place(
    template: Surface,
    attachments: Mapping[str, IntArray],
    warp: Callable[[Array], Array],
    edge: float,
    landmarks: Mapping[str, Array] | None = None,
    source: str | Path = "template",
) -> PlacedTemplate:
    """The warped template, remeshed, with its attachments.

    Where the template is thin the edges are shorter, lest triangles between points of its boundary cut its
    volume away. A vertex is attached if the nearest vertex of the template is.

    Parameters
    ----------
    template : Surface
        Template in its own frame.
    attachments : mapping of str to array (k,)
        Ids of the template's vertices that are attached to each bone.
    warp : callable
        Map of template points (n, 3) into the subject's neutral frame, in mm.
    edge : float
        Edge length in mm.
    landmarks : mapping of str to array (3,), optional
        Places in the template's frame, by label.
    source : path
        The file that errors name.

    Returns
    -------
    PlacedTemplate
        Surface in mm in the subject's neutral frame.

    Raises
    ------
    InputError
        Where fewer than three vertices are attached to a bone.
    """
    moved = Surface(warp(template.vertices), template.triangles)
    owner = np.full(len(moved.vertices), -1)
    names = list(attachments)
    for i, name in enumerate(names):
        owner[attachments[name]] = i
    labels = component_labels(moved.triangles)
    largest = np.bincount(labels, moved.triangle_areas()).argmax()
    finer = float(np.clip(ROUND * moved.volume() / moved.area(), FINEST * edge, edge))
    fine = remesh(moved, finer).largest_component()  # slivers thinner than an edge break off
    used = np.unique(moved.triangles[labels == largest])
    nearest = used[cKDTree(moved.vertices[used]).query(fine.vertices)[1]]
    found = {name: np.flatnonzero(owner[nearest] == i) for i, name in enumerate(names)}
    for name, ids in found.items():
        if len(ids) < 3:
            problem = f"only {len(ids)} vertices of the remeshed template attach to it"
            remedy = "Mark more vertices"
            if not np.isin(attachments[name], used).any():
                problem += ": those marked lie on a smaller part of its surface, which is left out"
                remedy = "Give a template of one piece"
            raise InputError(source, name, problem, remedy)
    marks = {label: warp(np.reshape(point, (1, 3))) for label, point in (landmarks or {}).items()}
    tree = cKDTree(fine.vertices)
    return PlacedTemplate(
        fine, found, {label: int(tree.query(point)[1][0]) for label, point in marks.items()}
    )


def read_attachments(path: str | Path, template: Surface) -> dict[str, IntArray]:
    """Ids of attached vertices by bone, from a JSON file {bone: [ids]}.

    The id of a vertex that no triangle uses, but that is at the place of one in use, becomes the id of the
    latter: seams have such vertices.

    Parameters
    ----------
    path : path
        JSON file.
    template : Surface
        The template whose vertices the file names.

    Returns
    -------
    dict of str to array (k,)
        Vertex ids of each bone, sorted.

    Raises
    ------
    InputError
        Where the file is malformed, or names vertices that the template lacks or does not use.
    """
    found = read_vertex_ids(path)
    for bone, ids in found.items():
        if len(ids) == 0 or ids.min() < 0 or ids.max() >= len(template.vertices):
            problem = f"has ids outside 0..{len(template.vertices) - 1}, or none"
            raise InputError(path, bone, problem, VERTEX_IDS)
        found[bone] = _in_use(path, bone, ids, template)
    return found


def read_vertex_ids(path: str | Path) -> dict[str, IntArray]:
    """Whole numbers by bone, from a JSON file {bone: [ids]}.

    Parameters
    ----------
    path : path
        JSON file.

    Returns
    -------
    dict of str to array (k,)
        Numbers of each bone, sorted, each once.

    Raises
    ------
    InputError
        Where the file cannot be read or is malformed.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8-sig"), object_pairs_hook=_no_key_twice)
        return {str(bone): _whole_numbers(ids) for bone, ids in content.items()}
    except (OSError, ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise InputError(path, "content", f"cannot be read ({error})", VERTEX_IDS) from error


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key stands twice")
    return found


def _whole_numbers(ids: Any) -> IntArray:
    found = np.asarray(ids)
    whole = np.unique(found.astype(np.int64))
    if found.ndim != 1 or found.dtype.kind not in "iuf" or not np.isin(found, whole).all():
        raise ValueError(f"{str(ids)[:40]} is no list of whole numbers")
    return whole


def _in_use(path: str | Path, bone: str, ids: IntArray, template: Surface) -> IntArray:
    """The ids, each of a vertex of some triangle."""
    used = np.unique(template.triangles)
    idle = np.setdiff1d(ids, used)
    if len(idle) == 0:
        return ids
    distances, nearest = cKDTree(template.vertices[used]).query(template.vertices[idle])
    if (distances > 0).any():
        stray = idle[distances > 0]
        problem = f"names {len(stray)} vertices that no triangle uses, the first is {stray[0]}"
        raise InputError(path, bone, problem, "Name vertices of the surface")
    return np.unique(np.concatenate([np.intersect1d(ids, used), used[nearest]]))


def require_near_bones(
    path: str | Path, template: Surface, attachments: Mapping[str, IntArray], bones: Mapping[str, Surface]
) -> None:
    """Refuse a template that is far from the template bones to which it attaches.

    Templates may be in any frame and unit, but all in the same one: half of the vertices that attach to a
    bone are nearer to it than three quarters of its size.

    Parameters
    ----------
    path : path
        The file that errors name.
    template : Surface
        Template of a muscle or ligament.
    attachments : mapping of str to array (k,)
        Ids of the vertices that are attached to each bone.
    bones : mapping of str to Surface
        Template bones. Attachments to other bones are not checked.

    Raises
    ------
    InputError
        Where the template is too far; the text names a likely cause if there is one.
    """
    groups = [
        (name, template.vertices[ids], Distance(bones[name]), NEAR * _size(bones[name]))
        for name, ids in attachments.items()
        if name in bones
    ]

    def near(matrix: Array) -> float:
        shares = [(bone.closest(x @ matrix.T)[0] < reach).mean() for _, x, bone, reach in groups]
        return float(min(shares, default=1.0))

    if near(np.eye(3)) >= 0.5:
        return
    far = [(name, float(np.median(bone.closest(x)[0])), reach) for name, x, bone, reach in groups]
    name, distance, reach = max(far, key=lambda group: group[1] / group[2])
    problem = f"attaches to {name}, but is {distance:.3g} mm away from its template"
    cause = likely_cause(near)
    remedy = (
        f"It would fit if it is in {cause}" if cause else "Give templates of bones and organs in one frame"
    )
    raise InputError(path, "frame", problem, remedy)


def _size(surface: Surface) -> float:
    return float(np.linalg.norm(np.ptp(surface.vertices[np.unique(surface.triangles)], axis=0)))
