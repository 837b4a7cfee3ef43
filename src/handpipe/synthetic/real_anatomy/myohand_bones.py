"""The bones of MyoHand: real shapes, with the model's axes and ranges of motion.

The neutral hand is slightly bent, by `REST` from the model's zero; angles count from there.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from handpipe.core import RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.phantom.phantom_hand_bones import WITH_ROOT
from handpipe.synthetic.real_anatomy import myohand_model, real_hand
from handpipe.synthetic.real_anatomy.real_hand import SourceHinge, Subject, Surface
from handpipe.synthetic.real_anatomy.source_meshes import folder_of, repair_mesh

NAME = "myohand-bones"
FOLDER = "myohand"
FINGER_REST = {"MP": 12.0, "PIP": 14.0, "DIP": 8.0}
# Degrees; angles that are not named are at the model's zero.
REST = {f"{joint}{ray}_flexion": v for joint, v in FINGER_REST.items() for ray in myohand_model.FINGERS}
# Where the model's bones would meet, and where the thumb meets the fingertips; found once by least squares.
# fmt: off
FIST: dict[str, float] = {
    "MP3_flexion": 60, "MP3_abduction": 3, "MP4_flexion": 60, "MP4_abduction": -9, "PIP4_flexion": 56,
    "DIP4_flexion": 47, "MP5_flexion": 65, "MP5_abduction": -2, "PIP5_flexion": 75, "CMC4_flexion": 0,
    "CMC5_flexion": 8,
}
CHANGES: dict[str, dict[str, float]] = {
    "fist": FIST | {
        "TM_flexion": 9, "TM_abduction": -3, "MP1_flexion": 24, "MP1_abduction": 3, "IP1_flexion": 44,
        "MP2_flexion": 65,
    },
    "oppose_little": {
        "TM_flexion": 9, "TM_abduction": 25, "MP1_flexion": 22, "MP1_abduction": 6, "IP1_flexion": 39,
        "MP5_flexion": 34, "MP5_abduction": 14, "PIP5_flexion": 32, "DIP5_flexion": 29, "CMC5_flexion": 9,
    },
    "oppose_index": {
        "TM_flexion": 16, "TM_abduction": 19, "MP1_flexion": 18, "MP1_abduction": 2, "IP1_flexion": -14,
        "MP2_flexion": 55, "MP2_abduction": -6, "PIP2_flexion": 18, "DIP2_flexion": 15,
    },
    "oppose_middle": {
        "TM_flexion": 17, "TM_abduction": 15, "MP1_flexion": 25, "MP1_abduction": 2, "IP1_flexion": -14,
        "MP3_flexion": 56, "MP3_abduction": -4, "PIP3_flexion": 3, "DIP3_flexion": 66,
    },
    "oppose_ring": {
        "TM_flexion": 19, "TM_abduction": 13, "MP1_flexion": 19, "MP1_abduction": 12, "IP1_flexion": -21,
        "MP4_flexion": 65, "MP4_abduction": 3, "PIP4_flexion": -1, "DIP4_flexion": 0, "MP5_flexion": 32,
        "MP5_abduction": 5, "PIP5_flexion": 19, "CMC4_flexion": -1, "CMC5_flexion": 17,
    },
    "point": FIST,
}
# fmt: on


def read(folder: Path) -> tuple[dict[str, Surface], dict[str, SourceHinge]]:
    """Closed bones and hinges by angle at the model's zero, in the frame of `real_hand.hand_frame`."""
    meshes = {n: repair_mesh(myohand_model.read_bone(folder / FOLDER, n), n) for n in myohand_model.BONES}
    raw = {name: (mesh.vertices, mesh.triangles) for name, mesh in meshes.items()}
    place = real_hand.hand_frame(raw)
    known = myohand_model.read_joints(folder / FOLDER)
    hinges = {}
    for angle, (name, sign) in myohand_model.ANGLES.items():
        axis = sign * known[name].axis / np.linalg.norm(known[name].axis)
        hinges[angle] = SourceHinge(axis, known[name].centre).moved(place)
    return {name: (place(points), triangles) for name, (points, triangles) in raw.items()}, hinges


def neutral(folder: Path) -> tuple[dict[str, Surface], dict[str, SourceHinge]]:
    """The same, slightly bent by `REST`."""
    bones, hinges = read(folder)
    joints = real_hand.joints(real_hand.own_frames(bones, hinges), hinges)
    still = [replace(j, residual_rotation=np.zeros(3), residual_translation=np.zeros(3)) for j in joints]
    angles = {a: float(np.radians(REST.get(a, 0.0))) for j in joints for a in j.angles}
    moves = Posture(tuple(still), angles, RigidTransform.identity(), WITH_ROOT).transforms()
    carrier = {angle: joint.parent for joint in joints for angle in joint.angles}
    return (
        {name: (moves[name](points), triangles) for name, (points, triangles) in bones.items()},
        {angle: hinge.moved(moves[carrier[angle]]) for angle, hinge in hinges.items()},
    )


def limits(folder: Path) -> dict[str, tuple[float, float]]:
    """Ranges of the model's angles in degrees, counted from neutral."""
    known = myohand_model.read_joints(folder / FOLDER)
    found = {}
    for angle in myohand_model.ANGLES:
        low, high = myohand_model.limits_of(angle, known)
        found[angle] = low - REST.get(angle, 0.0), high - REST.get(angle, 0.0)
    return found


@cache
def subject(folder: Path) -> Subject:
    """The hand of an anatomy folder."""
    bones, hinges = neutral(folder)
    return real_hand.subject(NAME, bones, hinges, real_hand.poses(limits(folder), CHANGES))


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
