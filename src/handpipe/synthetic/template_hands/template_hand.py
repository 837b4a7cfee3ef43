"""The bones, joints and skin that the template hand is built on: the phantom hand's, meshed for tets."""

from __future__ import annotations

from dataclasses import replace

from handpipe.anatomy.person import SubjectTemplate, scaled
from handpipe.anatomy.templates import HandFile, HandTemplate, MuscleCurves
from handpipe.mesh.generation import remesh
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.hand_skin import skin_surface
from handpipe.synthetic.template_hands import hand_templates

LIGAMENT_TISSUE = 1.5  # of the file's, in other hands than the median one
LIGAMENT_REACH = 4.0  # mm of the median hand about a ligament's ends within which it is attached


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

    Muscles have its volumes. Ligaments are firmer: those of the file just keep their place beside the median
    hand's muscles, and other muscles cut them off.

    Parameters
    ----------
    file : HandFile
        Curves of the median hand.
    build : HandBuild
        The other hand.

    Returns
    -------
    HandFile
        Curves with other volumes in mm^3, and ligaments with other tissue values.
    """

    def muscle(name: str, curves: MuscleCurves) -> MuscleCurves:
        volume = None if curves.volume is None else curves.volume * build.volume(name)
        return curves.model_copy(update={"volume": volume})

    def ligament(curves: MuscleCurves) -> MuscleCurves:
        firm = [
            line.model_copy(
                update={
                    "points": tuple(
                        p.model_copy(update={"tissue": LIGAMENT_TISSUE * p.tissue}) for p in line.points
                    )
                }
            )
            for line in curves.curves
        ]
        return curves.model_copy(update={"curves": tuple(firm), "reach": LIGAMENT_REACH})

    return file.model_copy(
        update={
            "muscles": {name: muscle(name, m) for name, m in file.muscles.items()},
            "ligaments": {name: ligament(curves) for name, curves in file.ligaments.items()},
        }
    )


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
