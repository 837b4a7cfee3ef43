"""Warps of a template to a person by feature points (Albrecht 2003 §5.2), and by the person's own bones."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.anatomy.person.feature_points import Points, matched
from handpipe.anatomy.person.posing import posed
from handpipe.anatomy.person.subject_template import (
    SpaceMap,
    SubjectTemplate,
    TemplateJoint,
    rotation_of,
    warped,
)
from handpipe.core import Array, InputError
from handpipe.mesh.surfaces import Biharmonic, Surface
from handpipe.tissues.muscles.fitting import BoneWarp, fit_similarity

log = logging.getLogger(__name__)

MIRRORED = 0.6  # largest residual of the mirror image, over the template's, that indicates the other hand


@dataclass(frozen=True)
class Composed:
    """One map after another."""

    first: SpaceMap
    then: SpaceMap

    def __call__(self, points: Array) -> Array:
        """Images (n, 3) in mm of points (n, 3) in mm: `then` of `first`."""
        return self.then(self.first(points))

    def jacobian(self, points: Array) -> Array:
        """Derivatives (n, 3, 3) of the images by the points (n, 3) in mm, by the chain rule."""
        return self.then.jacobian(self.first(points)) @ self.first.jacobian(points)


def biharmonic_warp(source: Points, target: Points, origin: str | Path = "feature points") -> Biharmonic:
    """The paper's warp: the map of least bending energy through the points that both hands have.

    Parameters
    ----------
    source, target : mapping of str to array (3,)
        Feature points in mm by name.
    origin : path
        The file of the target points, for messages.

    Returns
    -------
    Biharmonic
        Map of points in mm.

    Raises
    ------
    InputError
        For too few points, and for points in one plane.
    """
    _, a, b = matched(source, target, origin)
    try:
        return Biharmonic(a, b)
    except (ValueError, np.linalg.LinAlgError) as error:
        problem = f"they determine no warp ({error})"
        raise InputError(origin, "feature points", problem, "Place points that do not coincide") from error


def feature_warp(
    template: SubjectTemplate, target: Points, origin: str | Path = "feature points"
) -> SpaceMap:
    """The warp of a template's space through a person's feature points in 3D.

    First the template takes the person's pose and proportions by its joints (`posing`), then the paper's warp
    moves the points by the rest, so that they are met exactly.

    Parameters
    ----------
    template : SubjectTemplate
        Template with feature points.
    target : mapping of str to array (3,)
        The person's feature points in mm by name.
    origin : path
        The file of the target points, for messages.

    Returns
    -------
    SpaceMap
        Map of points in mm.

    Raises
    ------
    InputError
        For too few points, and for those of the other hand.
    """
    _require_same_hand(template, target, origin)
    first = posed(template, target)
    moved = {name: first(point[None])[0] for name, point in template.feature_points.items()}
    return Composed(first, biharmonic_warp(moved, target, origin))


def _require_same_hand(template: SubjectTemplate, target: Points, origin: str | Path) -> None:
    _, a, b = matched(template.feature_points, target, origin)

    def error(source: Array) -> float:
        return float(np.sqrt(((fit_similarity(source, b)(source) - b) ** 2).sum(axis=1).mean()))

    if error(a * [1.0, -1.0, 1.0]) < MIRRORED * error(a):
        other = "left" if template.side == "right" else "right"
        problem = f"are those of a {other} hand, the template is of a {template.side} one"
        raise InputError(
            origin,
            "feature points",
            problem,
            "Mirror the template: `template.mirrored()`, or the option --mirror",
        )


def folds(warp: SpaceMap, template: SubjectTemplate) -> dict[str, tuple[Array, float]]:
    """Where the warp inverts the template, at the vertices of its surfaces.

    Parameters
    ----------
    warp : SpaceMap
        Map of the template's space.
    template : SubjectTemplate
        Template whose surfaces are checked.

    Returns
    -------
    mapping of str to tuple
        By surface, the place (3,) in mm in the template where the Jacobian's determinant is least, and that
        determinant. Surfaces without an inverted place are absent.
    """
    found = {}
    for name, surface in template.surfaces().items():
        determinants = np.linalg.det(warp.jacobian(surface.vertices))
        worst = int(np.argmin(determinants))
        if determinants[worst] <= 0:
            found[name] = surface.vertices[worst], float(determinants[worst])
    return found


def require_invertible(warp: SpaceMap, template: SubjectTemplate, origin: str | Path) -> None:
    """Check that a warp inverts no surface of a template.

    Parameters
    ----------
    warp : SpaceMap
        Map of the template's space.
    template : SubjectTemplate
        Template whose surfaces are checked.
    origin : path
        The file of the target points, for messages.

    Raises
    ------
    InputError
        For inverted surfaces; the text names them and the worst place.
    """
    found = folds(warp, template)
    if found:
        name, (place, _) = min(found.items(), key=lambda item: item[1][1])
        where = ", ".join(f"{c:.1f}" for c in place)
        nearest = min(
            template.feature_points, key=lambda n: float(np.linalg.norm(template.feature_points[n] - place))
        )
        problem = f"the warp turns {', '.join(found)} inside out, most at ({where}) of the template"
        raise InputError(origin, nearest, problem, f"Look at {nearest} and what is around it")


def subject_template(
    template: SubjectTemplate, target: Points, origin: str | Path = "feature points"
) -> SubjectTemplate:
    """The template of a person, from the person's feature points in 3D.

    Parameters
    ----------
    template : SubjectTemplate
        Template with feature points.
    target : mapping of str to array (3,)
        The person's feature points in mm by name.
    origin : path
        The file of the target points, for messages.

    Returns
    -------
    SubjectTemplate
        The template in the person's shape.

    Raises
    ------
    InputError
        For too few points, for those of the other hand, and where the warp inverts a surface.
    """
    warp = feature_warp(template, target, origin)
    require_invertible(warp, template, origin)
    return warped(template, warp)


def refined(template: SubjectTemplate, bones: Mapping[str, Surface]) -> SubjectTemplate:
    """A person's template fitted to the person's own bones.

    Each bone is registered by an affine map and closest points, and the space between follows, feature points
    included. Axes turn as their bones do. The log names inverted places, which happen where neighbouring
    bones almost touch.

    Parameters
    ----------
    template : SubjectTemplate
        The person's template.
    bones : mapping of str to Surface
        The person's bones in mm; those that the template has, too, count.

    Returns
    -------
    SubjectTemplate
        The template on these bones.

    Raises
    ------
    InputError
        Where no bone is one of the template.
    ConvergenceError
        Where a bone cannot be registered.

    References
    ----------
    Wang 2021 §6.1.
    """
    both = [name for name in template.bones if name in bones]
    if not both:
        known = ", ".join(template.bones)
        raise InputError("bones", "names", "none is a bone of the template", f"The template has {known}")
    warp = BoneWarp({n: template.bones[n] for n in both}, {n: bones[n] for n in both})
    for name, (place, determinant) in folds(warp, template).items():
        at = ", ".join(f"{c:.1f}" for c in place)
        log.warning("%s is turned inside out near (%s): determinant %.2f", name, at, determinant)
    found = warped(template, warp)
    joints = tuple(
        replace(new, axes=old.axes @ _mean_turn(warp, old).T) if {old.parent, old.child} & set(both) else new
        for old, new in zip(template.joints, found.joints, strict=True)
    )
    return replace(found, joints=joints)


def _mean_turn(warp: BoneWarp, joint: TemplateJoint) -> Array:
    """The mean rotation (3, 3) of a joint's registered bones.

    The map's own derivatives are unreliable between bones that almost touch.
    """
    own = [warp.registered[b].matrix for b in (joint.parent, joint.child) if b in warp.registered]
    return Rotation.from_matrix(rotation_of(np.array(own))).mean().as_matrix()
