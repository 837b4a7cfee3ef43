"""A person's hand in the template's own pose, from feature points in 3D or in a photograph."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from handpipe.anatomy.person.feature_points import (
    NAMES,
    REASONABLE,
    Points,
    require_apart,
    require_enough,
    require_plausible,
)
from handpipe.anatomy.person.photograph import Lifted, Photograph, from_photograph
from handpipe.anatomy.person.posing import PosedHand, Skeleton, fit_pose
from handpipe.anatomy.person.subject_template import SubjectTemplate, warped
from handpipe.anatomy.person.warp import Composed, biharmonic_warp, require_invertible
from handpipe.core import Array, InputError
from handpipe.tissues.muscles.fitting import Affine

log = logging.getLogger(__name__)

# mm, for hands of one size; with 15 mm one of eight hands of other proportions was refused with right points
DOUBT = 20.0
LIKELIER = 0.6  # of the template's misfit: with less, the other hand's bones explain points better
Pose = Mapping[str, float]  # angles in rad by name
FINGERS_ALONE = tuple(n for n in NAMES if n[-1] in "2345" and n != "web12")  # lie flat; the thumb does not


def person_of_points(
    template: SubjectTemplate,
    target: Points,
    pose: Pose | None = None,
    origin: str | Path = "feature points",
) -> SubjectTemplate:
    """The template in a person's sizes and shape, in its own pose, from points of the hand in another pose.

    The template's joints take the person's pose; each point goes back with its bone. Limits of joints and
    rest shapes therefore keep their meaning. The paper's warp then meets the points exactly.

    Parameters
    ----------
    template : SubjectTemplate
        Template with feature points.
    target : mapping of str to array (3,)
        The person's feature points in mm by name.
    pose : mapping of str to float, optional
        Angles in rad in which the hand is expected; zero, the template's own pose, where absent.
    origin : path
        The file of the target points, for messages.

    Returns
    -------
    SubjectTemplate
        The person's template.

    Raises
    ------
    InputError
        For fewer than 16 points, for points that coincide or are those of the other hand, and where the warp
        inverts a surface.

    References
    ----------
    Albrecht 2003 §5.2.
    """
    known = {name: target[name] for name in template.feature_points if name in target}
    require_enough(known, origin, REASONABLE, template.feature_points)
    require_apart(known, origin)
    found = fit_pose(template, known, pose)
    other = _posed(template, {}).mirrored()
    if fit_pose(other, known, pose).misfit < LIKELIER * found.misfit:
        problem = f"are those of a {other.side} hand, not of a {template.side} one"
        raise InputError(origin, "feature points", problem, f"Say that it is a {other.side} hand")
    return _at_rest(template, found, known, origin)


def person_of_photograph(
    template: SubjectTemplate,
    photograph: Photograph,
    pose: Pose | None = None,
    origin: str | Path = "photograph",
) -> tuple[SubjectTemplate, Lifted]:
    """The template in the sizes and shape of a photographed hand, in its own pose.

    Parameters
    ----------
    template : SubjectTemplate
        Template of the photographed hand's side, with feature points and the joints MP2 to MP5.
    photograph : Photograph
        Points in pixels, and the ruler.
    pose : mapping of str to float, optional
        Angles in rad of the hand in the photograph, e.g. those of a flat one.
    origin : path
        The file of the photograph's points, for messages.

    Returns
    -------
    person : SubjectTemplate
        The person's template.
    lifted : Lifted
        Points in 3D in the pose of the photograph.

    Raises
    ------
    InputError
        As `from_photograph` and `person_of_points`; where the picture shows the other hand or the other side
        of the hand; and for points that contradict the others.
    """
    known = {name for name in template.feature_points if name in photograph.points}
    require_enough(dict.fromkeys(known), origin, REASONABLE, template.feature_points)
    shown = _posed(template, pose or {})
    lifted = from_photograph(shown, photograph, origin, FINGERS_ALONE)
    if lifted.mirrored != (photograph.view == "palm"):
        other = {"right": "left", "left": "right"}[photograph.hand]
        problem = f"show the {photograph.view} of a {other} hand, not of a {photograph.hand} one"
        remedy = f"Say that it is the {other} hand, or the other side of the {photograph.hand} one"
        raise InputError(origin, "points", problem, remedy)
    require_plausible(shown.feature_points, lifted.points, origin, DOUBT)
    return _at_rest(template, fit_pose(template, lifted.points, pose), lifted.points, origin), lifted


def _posed(template: SubjectTemplate, pose: Pose) -> SubjectTemplate:
    """Bones, joints and feature points in a pose: what points of a photograph are compared with."""
    skeleton = Skeleton(template)
    maps = skeleton.maps(Affine(np.eye(3), np.zeros(3)), pose)
    joints = tuple(
        replace(j, centre=maps[j.parent](j.centre), axes=j.axes @ maps[j.parent].matrix.T)
        for j in template.joints
    )
    bones = {name: surface.moved(maps[name](surface.vertices)) for name, surface in template.bones.items()}
    points = skeleton.moved_points(maps)
    return SubjectTemplate(
        template.side, bones, joints, feature_points=points, moves_with=template.moves_with
    )


def _at_rest(
    template: SubjectTemplate, hand: PosedHand, target: Points, origin: str | Path
) -> SubjectTemplate:
    """The template warped to a hand's sizes, and to its points as they lie at rest."""
    skeleton, there, here = hand.skeleton, hand.maps(), hand.maps_at_rest()
    wanted = {
        name: skeleton.carrier(name, here)(_before(skeleton.carrier(name, there), point))
        for name, point in target.items()
    }
    field = skeleton.field(here)
    sized = {name: field(template.feature_points[name][None])[0] for name in wanted}
    warp = Composed(field, biharmonic_warp(sized, wanted, origin))
    require_invertible(warp, template, origin)
    return warped(template, warp)


def _before(motion: Affine, point: Array) -> Array:
    """The point (3,) that an affine map takes to a given one."""
    return np.asarray(np.linalg.solve(motion.matrix, point - motion.offset))
