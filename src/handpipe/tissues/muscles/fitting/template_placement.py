"""A muscle's template carried to the subject by the bones that both have (Wang 2021 §6.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, InputError, IntArray
from handpipe.imaging.volumes import likely_cause
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces import Biharmonic, Distance, Surface, component_labels, sample_points
from handpipe.tissues.muscles.fitting.template_bones import SAMPLES, register_bones

SMOOTHING = 0.5  # mm
ROUND = 0.85  # of V / A, half the radius of a long round body: 15 edges around it, which cut off 3 % of it
NEAR = 0.75  # of a bone's size: what attaches to it is nearer
FINEST = 0.4  # of the edge length that is asked for
SHORTER = (1.0, 0.7, 0.5)  # times the edge length, in turn, while an attached end is cut off
FEWEST = 3  # vertices that are attached to a bone: fewer do not hold its rotation


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
    volume away, and shorter still where they would cut off a thin end that is attached. A vertex is attached
    if the nearest vertex of the template is.

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
    used = np.unique(moved.triangles[labels == largest])
    tree = cKDTree(moved.vertices[used])
    finer = float(np.clip(ROUND * moved.volume() / moved.area(), FINEST * edge, edge))
    for shorter in SHORTER:
        fine = remesh(moved, shorter * finer).largest_component()  # slivers thinner than an edge break off
        nearest = used[tree.query(fine.vertices)[1]]
        found = {name: np.flatnonzero(owner[nearest] == i) for i, name in enumerate(names)}
        if all(len(ids) >= FEWEST for ids in found.values()):
            break
    for name, ids in found.items():
        if len(ids) < FEWEST:
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
