"""The bones, joints and skin that the template hand is built on: the phantom hand's, meshed for tets."""

from __future__ import annotations

from dataclasses import replace

from handpipe.anatomy.person import SubjectTemplate
from handpipe.mesh.generation import remesh
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.hand_skin import skin_surface
from handpipe.synthetic.template_hands import hand_templates


def bare_hand(bone_edge: float, skin_edge: float) -> SubjectTemplate:
    """Phantom hand in neutral without soft tissue.

    Parameters
    ----------
    bone_edge, skin_edge : float
        Approximate edge lengths in mm of the triangles of bones and skin.

    Returns
    -------
    SubjectTemplate
        Bones, joints and skin in mm.
    """
    known = hand_templates.phantom()
    bones = {name: remesh(bone, bone_edge) for name, bone in known.bones.items()}
    return replace(known, bones=bones, skin=skin_surface(phantom_hand.layout(), skin_edge))
