"""The bones, joints and skin that the template hand is built on: the phantom hand's, meshed for tets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from handpipe.anatomy.person import SubjectTemplate, scaled
from handpipe.anatomy.templates import ControlPoint, HandFile, HandTemplate, MuscleCurves
from handpipe.mesh.generation import remesh
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.hand_skin import skin_surface
from handpipe.synthetic.phantom.phantom_hand_bones import stretch
from handpipe.synthetic.template_hands import hand_templates

BULGE = 0.2  # mm that a ligament keeps farther off a bone between two points on it


def bare_hand(bone_edge: float, skin_edge: float, build: HandBuild | None = None) -> SubjectTemplate:
    """Phantom hand in neutral without soft tissue.

    Parameters
    ----------
    bone_edge, skin_edge : float
        Approximate edge lengths in mm of the triangles of bones and skin.
    build : HandBuild, optional
        Another hand than the median one, here as large as that one (`at_its_size`).

    Returns
    -------
    SubjectTemplate
        Bones, joints and skin in mm.
    """
    known = hand_templates.phantom(build)
    skin = skin_surface(phantom_hand.layout(build), skin_edge)
    if build is not None:
        known, skin = scaled(known, 1.0 / build.size), skin.moved(build.shaped(skin.vertices))
    bones = {name: remesh(bone, bone_edge) for name, bone in known.bones.items()}
    return replace(known, bones=bones, skin=skin)


def of_build(file: HandFile, build: HandBuild) -> HandFile:
    """The file of curves for another hand, as large as the median one.

    Muscles have its volumes, as long as the bones that they are on. Ligaments follow each bone more closely:
    its head may bulge farther between two points, and no tissue is kept inside of it.

    Parameters
    ----------
    file : HandFile
        Curves of the median hand.
    build : HandBuild
        The other hand.

    Returns
    -------
    HandFile
        Curves with other volumes in mm^3, and ligaments with more points.
    """
    longer = stretch(build)

    def muscle(name: str, organ: MuscleCurves) -> MuscleCurves:
        if organ.volume is None:
            return organ
        bones = [point.bone for curve in organ.curves for point in curve.points]
        length = float(np.mean([longer.get(bone or "", 1.0) for bone in bones]))
        return organ.model_copy(update={"volume": organ.volume * build.volume(name) * length})

    def ligament(organ: MuscleCurves) -> MuscleCurves:
        curves = tuple(c.model_copy(update={"points": tuple(_followed(c.points))}) for c in organ.curves)
        return organ.model_copy(update={"curves": curves})

    return file.model_copy(
        update={
            "muscles": {name: muscle(name, m) for name, m in file.muscles.items()},
            "ligaments": {name: ligament(organ) for name, organ in file.ligaments.items()},
        }
    )


def _followed(points: Sequence[ControlPoint]) -> list[ControlPoint]:
    """The points, and one more between any two on one bone, higher by `BULGE`."""
    found = [points[0]]
    for before, after in pairwise(points):
        if before.bone is not None and before.bone == after.bone:
            towards = sum(np.array(p.towards) / np.linalg.norm(np.array(p.towards)) for p in (before, after))
            between = {
                "along": (before.along + after.along) / 2,
                "height": (before.height + after.height) / 2 + BULGE,
                "towards": tuple(np.asarray(towards).tolist()),
            }
            found.append(before.model_copy(update=between))
        found.append(after)
    return found


def at_its_size(hand: HandTemplate, build: HandBuild) -> HandTemplate:
    """A hand that was built as large as the median one, at its own size.

    Parameters
    ----------
    hand : HandTemplate
        Hand as large as the median one.
    build : HandBuild
        What it is built by.

    Returns
    -------
    HandTemplate
        The hand in mm of the person.
    """
    return HandTemplate(hand.tissue.scaled(build.size), scaled(hand.subject, build.size))
