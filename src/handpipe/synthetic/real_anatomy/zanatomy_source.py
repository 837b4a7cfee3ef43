"""Real anatomy of one index finger, read from its source folder into the phantoms' frame.

Bones, muscles and tendons are those of Z-Anatomy's right hand; joint axes are MyoHand's, carried over bone by
bone.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import igl
import numpy as np

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.geometry.kinematics import KnownJoint
from handpipe.synthetic.real_anatomy import myohand_model
from handpipe.synthetic.real_anatomy.carried_joints import Similarity, carried, similarity
from handpipe.synthetic.real_anatomy.source_meshes import read_mesh, repair_mesh, subdivided

Surface = tuple[Array, IntArray]
log = logging.getLogger(__name__)

MUSCLE_EDGE = 1.3  # mm
HAND = "zanatomy_right_hand/meshes_mm"
BONES = {
    "metacarpal2": "Second_metacarpal_bone_r",
    "proximal2": "Proximal_phalanx_of_second_finger_of_hand_r",
    "middle2": "Middle_phalanx_of_second_finger_of_hand_r",
    "distal2": "Distal_phalanx_of_second_finger_of_hand_r",
}
MUSCLES = {
    "dorsal_interosseous1": "Dorsal_interossei_muscles_of_hand_r",
    "lumbrical1": "Lumbrical_muscles_of_hand_r",
}
FLEXORS = ("Flexor_digitorum_profundus_r", "Humero_ulnar_head_of_flexor_digitorum_superficialis_r")
EXTENSOR = "Extensor_indicis_r"
# joint: parent, child, {angle: joint of the model}, residual rotation in degrees, residual translation in mm
JOINTS = {
    "MP2": (
        ("metacarpal2", "proximal2"),
        {"MP2_flexion": "mcp2_flexion", "MP2_abduction": "mcp2_abduction"},
        (1.4, 0.0, 0.7),
        (0.1, 0.1, -0.2),
    ),
    "PIP2": (("proximal2", "middle2"), {"PIP2_flexion": "pm2_flexion"}, (1.0, 0.0, -0.6), (0.1, 0.05, -0.15)),
    "DIP2": (("middle2", "distal2"), {"DIP2_flexion": "md2_flexion"}, (-0.8, 0.0, 0.5), (0.05, 0.0, -0.1)),
}


@dataclass(frozen=True)
class FingerSource:
    """The finger in the neutral frame: +x distal along the metacarpal, +y radial, +z dorsal, origin in it.

    Tendon lines (n, 3) run from proximal to distal.
    """

    bones: dict[str, Surface]
    muscles: dict[str, Surface]
    flexor: Array
    extensor: Array
    joints: tuple[KnownJoint, ...]


def read(folder: Path) -> FingerSource:
    """Read the finger; raise `InputError` naming what is absent."""
    raw = {name: _load(folder / HAND / f"{file}.ply", name) for name, file in BONES.items()}
    to_neutral = _neutral_frame(raw["metacarpal2"][0])
    bones = {name: (to_neutral(points), triangles) for name, (points, triangles) in raw.items()}
    muscles = {}
    for name, file in MUSCLES.items():
        points, triangles = _load(folder / HAND / f"{file}.ply", name, part=True)
        muscles[name] = to_neutral(points), triangles
    flexors = [to_neutral(read_mesh(folder / HAND / f"{file}.ply").vertices) for file in FLEXORS]
    extensor = to_neutral(read_mesh(folder / HAND / f"{EXTENSOR}.ply").vertices)
    return FingerSource(
        bones,
        muscles,
        _middle_line(np.concatenate(flexors), bones, -1.0),
        _middle_line(extensor, bones, 1.0),
        _joints(folder / "myohand", bones),
    )


def _load(path: Path, name: str, part: bool = False) -> Surface:
    """A closed surface; of several bodies (`part`) the most radial one, which lies first in world x."""
    mesh = read_mesh(path)
    if part:
        mesh = min(mesh.components(), key=lambda body: float(body.vertices[:, 0].min())).compact()
        # A repair that must rebuild does so at the size of the triangles: make them small beforehand.
        mesh = Mesh(*igl.upsample(mesh.vertices, mesh.triangles, 2))
    before = mesh.volume()
    mesh = repair_mesh(mesh, name)
    if part:
        mesh = remesh(mesh, MUSCLE_EDGE)
        log.info("%s: volume %.0f mm^3 as read, %.0f mm^3 as used", name, before, mesh.volume())
        return mesh.vertices, mesh.triangles
    mesh = subdivided(mesh)
    return mesh.vertices, mesh.triangles


def _long_axis(points: Array) -> Array:
    """Unit vector along a bone, to distal, in a hand that hangs along -y."""
    axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return axis * -np.sign(axis[1])


def _axes(distal: Array, radial: Array) -> Array:
    """Rotation (3, 3) whose columns are distal, radial (made perpendicular) and dorsal."""
    y = radial - (radial @ distal) * distal
    y /= np.linalg.norm(y)
    return np.column_stack([distal, y, np.cross(distal, y)])


def _neutral_frame(metacarpal: Array) -> RigidTransform:
    """From the source's frame, in which -x is radial, to the neutral one."""
    axes = _axes(_long_axis(metacarpal), np.array([-1.0, 0.0, 0.0]))
    return RigidTransform(axes.T, -axes.T @ metacarpal.mean(axis=0))


def _middle_line(points: Array, bones: Mapping[str, Surface], side: float) -> Array:
    """Line through the middles of a tendon's points, binned over x, to its insertion on the distal bone."""
    start = bones["metacarpal2"][0][:, 0].min() - 8.0
    spine = np.array([[p[:, 0].mean(), p[:, 1].mean()] for p, _ in bones.values()])
    beside = np.abs(points[:, 1] - np.interp(points[:, 0], spine[:, 0], spine[:, 1])) < 9.0
    near = points[beside & (points[:, 0] > start)]
    bins = np.arange(start + 2.0, near[:, 0].max() - 1.5, 3.0)
    middles = []
    for x in bins:
        members = near[np.abs(near[:, 0] - x) < 3.0]
        if len(members):
            middles.append([x, np.median(members[:, 1]), 0.5 * (members[:, 2].min() + members[:, 2].max())])
    middles.append(near[near[:, 0] > near[:, 0].max() - 2.0].mean(axis=0))
    knots = np.array(middles)
    fine = np.arange(knots[0, 0], knots[-1, 0], 0.25)
    return np.column_stack([fine, *(np.interp(fine, knots[:, 0], knots[:, d]) for d in (1, 2))])


def _joints(folder: Path, bones: Mapping[str, Surface]) -> tuple[KnownJoint, ...]:
    """The model's joints, carried by the similarity of each bone's neighbours, averaged over the two."""
    known = myohand_model.read_joints(folder)
    carry = {name: _similarity(folder, name, bones[name]) for name in BONES}
    result = []
    for name, ((parent, child), angles, turn, shift) in JOINTS.items():
        axes, centre = carried(name, [known[joint] for joint in angles.values()], (parent, child), carry)
        along = [_long_axis_towards(bones[bone][0]) for bone in (parent, child)]
        direction = along[0] + along[1]
        result.append(
            KnownJoint(
                name,
                parent,
                child,
                tuple(angles),
                axes,
                centre,
                np.radians(turn),
                np.array(shift),
                direction / np.linalg.norm(direction),
            )
        )
    return tuple(result)


def _long_axis_towards(points: Array) -> Array:
    """Unit vector along a bone in the neutral frame, to distal (+x)."""
    axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return axis * np.sign(axis[0])


def _similarity(folder: Path, name: str, bone: Surface) -> Similarity:
    """Matrix and offset that carry the model's bone (palm to +x, radial +z) onto ours."""
    model = myohand_model.read_bone(folder, name)
    ours = _axes(_long_axis_towards(bone[0]), np.array([0.0, 1.0, 0.0]))
    theirs = _axes(_long_axis(model.vertices), np.array([0.0, 0.1, 0.995]))
    return similarity(model, bone, ours, theirs)
