"""The bones of Z-Anatomy's right hand, with MyoHand's axes and ranges of motion carried over bone by bone.

The neutral hand is the source's, which is slightly bent; angles count from there.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.real_anatomy import myohand_bones, myohand_model, real_hand
from handpipe.synthetic.real_anatomy.carried_joints import Similarity, carried, similarity
from handpipe.synthetic.real_anatomy.real_hand import CARPALS, RAYS, SourceHinge, Subject, Surface
from handpipe.synthetic.real_anatomy.source_meshes import folder_of, read_mesh, repair_mesh, subdivided
from handpipe.synthetic.real_anatomy.zanatomy_source import HAND

log = logging.getLogger(__name__)

NAME = "zanatomy-bones"
RAY_NAMES = {1: "first", 2: "second", 3: "third", 4: "fourth", 5: "fifth"}
FILES = {
    **{f"metacarpal{ray}": f"{name.capitalize()}_metacarpal_bone_r" for ray, name in RAY_NAMES.items()},
    **{
        f"{kind}{ray}": f"{kind.capitalize()}_phalanx_of_{name}_finger_of_hand_r"
        for ray, name in RAY_NAMES.items()
        for kind in (("proximal", "distal") if ray == 1 else ("proximal", "middle", "distal"))
    },
    **{name: f"{name.capitalize()}_bone_r" for name in CARPALS},
}
TARGET_POINTS = 20000  # about 0.2 mm apart on the largest bone
# Where bones would meet, and where the thumb meets the fingertips; found once by least squares.
# fmt: off
CHANGES: dict[str, dict[str, float]] = {
    "fist": {
        "TM_flexion": 13, "TM_abduction": -10, "MP1_abduction": -6, "IP1_flexion": 46, "MP3_flexion": 65,
        "MP3_abduction": 1, "PIP3_flexion": 84,
    },
    "bow": {
        "TM_flexion": 4, "TM_abduction": 20, "MP1_flexion": 11, "MP1_abduction": 5, "IP1_flexion": 9,
        "PIP2_flexion": 10,
    },
    "oppose_little": {  # as near as the thumb's range lets it come
        "TM_flexion": 28, "TM_abduction": 41, "MP1_abduction": 20, "IP1_flexion": 25, "MP5_flexion": 15,
        "PIP5_flexion": 63, "DIP5_flexion": 77, "CMC4_flexion": 8, "CMC5_flexion": 20,
    },
    "oppose_index": {
        "TM_flexion": 12, "TM_abduction": 20, "MP1_flexion": 11, "MP1_abduction": 4, "IP1_flexion": -6,
        "MP2_flexion": 40, "MP2_abduction": -7, "PIP2_flexion": 34, "DIP2_flexion": 33,
    },
    "oppose_middle": {
        "TM_flexion": 18, "TM_abduction": 16, "MP1_flexion": 19, "MP1_abduction": 7, "IP1_flexion": 32,
        "MP3_flexion": 42, "MP3_abduction": 3, "PIP3_flexion": 52, "DIP3_flexion": 52,
    },
    "oppose_ring": {
        "TM_flexion": 27, "TM_abduction": 23, "MP1_flexion": 24, "MP1_abduction": 16, "IP1_flexion": 7,
        "MP4_flexion": 39, "MP4_abduction": 3, "PIP4_flexion": 44, "DIP4_flexion": 40, "CMC4_flexion": 0,
    },
    "point": {"TM_flexion": 10, "TM_abduction": 7, "MP1_flexion": 18, "MP1_abduction": 1, "IP1_flexion": 32},
}
# fmt: on


def read(folder: Path) -> tuple[dict[str, Surface], dict[str, SourceHinge], dict[str, float]]:
    """Closed neutral bones, hinges by angle, and by angle how far neutral is from the model's zero (rad)."""
    meshes = {n: subdivided(repair_mesh(read_mesh(folder / HAND / f"{f}.ply"), n)) for n, f in FILES.items()}
    raw = {name: (mesh.vertices, mesh.triangles) for name, mesh in meshes.items()}
    place = real_hand.hand_frame(raw)
    bones = {name: (place(points), triangles) for name, (points, triangles) in raw.items()}
    model, known = myohand_bones.read(folder)
    joints = real_hand.joints(real_hand.own_frames(model, known), known)
    moving = [joint for joint in joints if set(joint.angles) & set(known)]
    jointed = {bone for joint in moving for bone in (joint.parent, joint.child)}
    carry = {name: _similarity(model, bones, name) for name in sorted(jointed)}
    hinges, rest = {}, {}
    for joint in moving:
        given = [angle for angle in joint.angles if angle in known]
        both = (joint.parent, joint.child)
        axes, centre = carried(joint.name, [known[angle] for angle in given], both, carry)
        turn = _turn(*(carry[bone] for bone in both))
        for angle, axis in zip(given, axes, strict=True):
            hinges[angle] = SourceHinge(axis, centre)
            rest[angle] = float(turn @ axis)
            log.info("%s: %.1f degrees from the model's zero", angle, np.degrees(rest[angle]))
    return bones, hinges, rest


def _similarity(model: Mapping[str, Surface], bones: Mapping[str, Surface], name: str) -> Similarity:
    """How the model's bone is carried onto ours, from where its long axis points."""
    ours, theirs = np.eye(3), np.eye(3)
    if name not in CARPALS:
        theirs = real_hand.axes_along(_outwards(model, name), np.array([0.0, 1.0, 0.0]))
        ours = _shortest_turn(theirs[:, 0], _outwards(bones, name)) @ theirs
    return similarity(Mesh(*model[name]), bones[name], ours, theirs, points=TARGET_POINTS)


def _outwards(bones: Mapping[str, Surface], name: str) -> Array:
    """Unit vector along a long bone, to distal."""
    chain = RAYS[int(name[-1])]
    i = chain.index(name)
    inner, outer = (chain[i - 1], name) if i else (name, chain[1])
    return real_hand.long_axis(bones[name][0], bones[outer][0].mean(axis=0) - bones[inner][0].mean(axis=0))


def _shortest_turn(start: Array, end: Array) -> Array:
    """Rotation (3, 3) that carries one unit vector to another by the shortest way."""
    across = np.cross(start, end)
    angle = np.arctan2(np.linalg.norm(across), start @ end)
    return Rotation.from_rotvec(angle * across / max(float(np.linalg.norm(across)), 1e-12)).as_matrix()


def _turn(parent: Similarity, child: Similarity) -> Array:
    """Rotation vector (3,) in rad of our child against our parent, compared with the model's."""
    parent_turn, child_turn = (matrix / np.cbrt(np.linalg.det(matrix)) for matrix, _ in (parent, child))
    return Rotation.from_matrix(child_turn @ parent_turn.T).as_rotvec()


def limits(folder: Path) -> dict[str, tuple[float, float]]:
    """Ranges of the model's angles in degrees, counted from neutral."""
    return _limits(folder, read(folder)[2])


def _limits(folder: Path, rest: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    known = myohand_model.read_joints(folder / myohand_bones.FOLDER)
    found = {}
    for angle, at in rest.items():
        low, high = myohand_model.limits_of(angle, known)
        found[angle] = low - float(np.degrees(at)), high - float(np.degrees(at))
    return found


@cache
def subject(folder: Path) -> Subject:
    """The hand of an anatomy folder."""
    bones, hinges, rest = read(folder)
    return real_hand.subject(NAME, bones, hinges, real_hand.poses(_limits(folder, rest), CHANGES))


def generate_pose(dataset: Dataset, pose: str) -> None:
    """Write a pose's volume, truth and label volumes where the dataset names them; `seeds.draw` adds seeds.

    Raises
    ------
    InputError
        For a pose or bones that this hand does not have, or where the source is absent.
    """
    subject(folder_of(dataset)).generate_pose(dataset, pose)


def generate_templates(dataset: Dataset) -> None:
    """Write the templates of bones that the dataset names: their own neutral surfaces."""
    subject(folder_of(dataset)).generate_templates(dataset)
