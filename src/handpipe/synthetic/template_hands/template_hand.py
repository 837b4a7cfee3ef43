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


def with_volumes(file: HandFile, build: HandBuild) -> HandFile:
    """The file of curves with the muscles' volumes of another hand, as large as the median one."""

    def muscle(name: str, curves: MuscleCurves) -> MuscleCurves:
        volume = None if curves.volume is None else curves.volume * build.volume(name)
        return curves.model_copy(update={"volume": volume})

    return file.model_copy(update={"muscles": {name: muscle(name, m) for name, m in file.muscles.items()}})


def at_its_size(hand: HandTemplate, build: HandBuild) -> HandTemplate:
    """A hand that was built as large as the median one, at its own size."""
    return HandTemplate(hand.tissue.scaled(build.size), scaled(hand.subject, build.size))
