"""The bones, joints and skin that the template hand is built on: the phantom hand's, meshed for tets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from handpipe.anatomy.person import SubjectTemplate, scaled
from handpipe.anatomy.templates import Curve, HandFile, HandTemplate, MuscleCurves, sunken
from handpipe.core import BoolArray
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.hand_skin import skin_surface
from handpipe.synthetic.phantom.phantom_hand_bones import stretch
from handpipe.synthetic.template_hands import hand_templates

BULGE = 0.2  # mm that a curve keeps farther off a bone between two points on it
SUNKEN = 0.3  # mm inside a bone at which a muscle's curve needs a further point: no tissue is kept there


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


def of_build(
    file: HandFile, build: HandBuild, bones: Mapping[str, Surface], *, source: str | Path = "hand"
) -> HandFile:
    """The file of curves for another hand, as large as the median one.

    Muscles have its volumes, as long as the bones that they are on, and tets as much smaller as they are
    thinner: a thin end falls apart in larger ones. A head may bulge farther between two points on a bone, and
    no tissue is kept inside of it: ligaments follow each bone more closely, and muscles where they would run
    inside of it.

    Parameters
    ----------
    file : HandFile
        Curves of the median hand.
    build : HandBuild
        The other hand.
    bones : mapping of str to Surface
        Its bones in mm, as large as the median hand's.
    source : path
        The file, for messages.

    Returns
    -------
    HandFile
        Curves with other volumes in mm^3 and more points.
    """
    longer = stretch(build)

    def muscle(name: str, organ: MuscleCurves) -> MuscleCurves:
        section = build.volume(name)
        on = [point.bone for curve in organ.curves for point in curve.points]
        length = float(np.mean([longer.get(bone or "", 1.0) for bone in on]))
        curves = tuple(
            _followed(c, sunken(c.points, bones, file.distal, source, f"muscles.{name}.curves.{i}") > SUNKEN)
            for i, c in enumerate(organ.curves)
        )
        volume = None if organ.volume is None else organ.volume * section * length
        edge = None if organ.edge_length is None else organ.edge_length * section**0.5
        return organ.model_copy(update={"curves": curves, "volume": volume, "edge_length": edge})

    def ligament(organ: MuscleCurves) -> MuscleCurves:
        curves = tuple(_followed(c, np.full(len(c.points) - 1, True)) for c in organ.curves)
        return organ.model_copy(update={"curves": curves})

    return file.model_copy(
        update={
            "muscles": {name: muscle(name, m) for name, m in file.muscles.items()},
            "ligaments": {name: ligament(organ) for name, organ in file.ligaments.items()},
        }
    )


def _followed(curve: Curve, closer: BoolArray) -> Curve:
    """The curve with one more point, higher by `BULGE`, after each point (n - 1,) where it is to be `closer`.

    Only between two points on one bone.
    """
    found = [curve.points[0]]
    for before, after, more in zip(curve.points[:-1], curve.points[1:], closer, strict=True):
        if more and before.bone is not None and before.bone == after.bone:
            towards = sum(np.array(p.towards) / np.linalg.norm(np.array(p.towards)) for p in (before, after))
            between = {
                "along": (before.along + after.along) / 2,
                "height": (before.height + after.height) / 2 + BULGE,
                "towards": tuple(np.asarray(towards).tolist()),
            }
            found.append(before.model_copy(update=between))
        found.append(after)
    return curve.model_copy(update={"points": tuple(found)})


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
