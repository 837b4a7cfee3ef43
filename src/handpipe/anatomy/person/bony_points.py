"""Feature points of a hand of which only bones and joints are known, as they would lie on its skin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import trimesh

from handpipe.anatomy.person.feature_points import FINGERS
from handpipe.anatomy.person.subject_template import TemplateJoint
from handpipe.core import Array, InputError
from handpipe.mesh.surfaces import Surface

KNUCKLE, TIP = 2.0, 3.0  # mm of soft tissue on the back of the joints and at the tips of a median adult
WEB = 0.45  # share of the proximal phalanx at which the skin between two fingers begins
FIRST_WEB = 0.7  # share of metacarpal II at which the skin between it and the thumb's knuckle begins
WRIST = 15.0  # mm at the ends of radius and ulna that count as wrist


def bony_feature_points(
    bones: Mapping[str, Surface], joints: Sequence[TemplateJoint], scale: float = 1.0
) -> dict[str, Array]:
    """Feature points of a hand of bones and joints, as they would lie on its skin.

    Knuckles: from a joint's centre to the back of the head of its parent, through the skin. Wrist: the ends
    of radius and ulna, and the back of the ulna's head.

    Parameters
    ----------
    bones : mapping of str to Surface
        Neutral surfaces in mm by bone.
    joints : sequence of TemplateJoint
        Joints of the hand.
    scale : float
        Size of the hand over that of a median adult; it scales the thickness of the skin.

    Returns
    -------
    mapping of str to array (3,)
        Points in mm by name, those for which the bones exist.

    Raises
    ------
    InputError
        Where a knuckle is not found.
    """
    of = {joint.name: joint for joint in joints}
    found: dict[str, Array] = {}
    for name in ("MP1", "IP1", *(f"{kind}{ray}" for ray in FINGERS for kind in ("MP", "PIP", "DIP"))):
        if name in of:
            found[name] = _knuckle(of[name], bones, KNUCKLE * scale)
    for last in ("IP1", *(f"DIP{ray}" for ray in FINGERS)):
        if last in of:
            points = bones[of[last].child].vertices
            axis = away_from(bones[of[last].child], of[last].centre)
            found[f"tip{last[-1]}"] = points[np.argmax(points @ axis)] + TIP * scale * axis
    found |= _webs(of, bones)
    if "radius" in bones and "ulna" in bones:
        found |= _wrist(of, bones, KNUCKLE * scale)
    return found


def away_from(bone: Surface, centre: Array) -> Array:
    """Unit vector along a bone's greatest extent, away from a point."""
    outwards = bone.vertices.mean(axis=0) - centre
    axis = np.linalg.svd(bone.vertices - bone.vertices.mean(axis=0), full_matrices=False)[2][0]
    return axis * np.sign(axis @ outwards)


def _knuckle(joint: TemplateJoint, bones: Mapping[str, Surface], skin: float) -> Array:
    """The feature point (3,) on the back of a knuckle.

    Flexion bends distal towards the palm about its axis, so that the back is distal x axis on either hand.
    """
    parent = bones[joint.parent]
    distal = -away_from(parent, joint.centre)
    back = np.cross(distal, joint.axes[0])
    back /= np.linalg.norm(back)
    mesh = trimesh.Trimesh(parent.vertices, parent.triangles, process=False)
    hits = mesh.ray.intersects_location(joint.centre[None], back[None])[0]
    if len(hits) == 0:
        problem = f"{joint.parent} has no surface behind its centre"
        raise InputError("template", f"joints.{joint.name}.centre", problem, "Check the joint's centre")
    return joint.centre + (float(((hits - joint.centre) @ back).max()) + skin) * back


def _webs(of: Mapping[str, TemplateJoint], bones: Mapping[str, Surface]) -> dict[str, Array]:
    found = {}
    sides = {
        ray: (1 - WEB) * of[f"MP{ray}"].centre + WEB * of[f"PIP{ray}"].centre
        for ray in FINGERS
        if {f"MP{ray}", f"PIP{ray}"} <= set(of)
    }
    for ray in FINGERS[:-1]:
        if ray in sides and ray + 1 in sides:
            found[f"web{ray}{ray + 1}"] = 0.5 * (sides[ray] + sides[ray + 1])
    if "MP1" in of and "MP2" in of:
        shaft = bones[of["MP2"].parent].vertices.mean(axis=0)
        # The shaft's middle is at half of the bone's length, so shares beyond a half count twice from there.
        palm = shaft + (2 * FIRST_WEB - 1) * (of["MP2"].centre - shaft)
        found["web12"] = 0.5 * (of["MP1"].centre + palm)
    return found


def _wrist(of: Mapping[str, TemplateJoint], bones: Mapping[str, Surface], skin: float) -> dict[str, Array]:
    distal = of["MP3"].centre - bones["radius"].vertices[np.argmin(_reach(bones["radius"], of["MP3"].centre))]
    distal /= np.linalg.norm(distal)
    radius, ulna = (_end(bones[name], distal) for name in ("radius", "ulna"))
    radial = radius.mean(axis=0) - ulna.mean(axis=0)
    radial -= (radial @ distal) * distal
    radial /= np.linalg.norm(radial)
    back = np.cross(-away_from(bones[of["MP3"].parent], of["MP3"].centre), of["MP3"].axes[0])
    return {
        "wrist_radial": radius[np.argmax(radius @ distal)] + skin * radial,
        "wrist_ulnar": ulna[np.argmax(ulna @ distal)] - skin * radial,
        "ulna_head": ulna[np.argmax(ulna @ back)] + skin * back / np.linalg.norm(back),
    }


def _reach(bone: Surface, point: Array) -> Array:
    return np.linalg.norm(bone.vertices - point, axis=1)


def _end(bone: Surface, distal: Array) -> Array:
    """Vertices at the distal end."""
    along = bone.vertices @ distal
    return bone.vertices[along > along.max() - WRIST]
