"""The phantom finger: its anatomy in any pose, and the files of a dataset made of it.

The truth is kinematic: closed-form maps pose every tissue. No code of the fitting pipeline is used.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, InputError, IntArray, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.synthetic.acquisition import scans
from handpipe.synthetic.acquisition.posed import PosedAnatomy, repositioning, write_pose, write_surface
from handpipe.synthetic.geometry import generic_hand
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.geometry.tubes import sweep
from handpipe.synthetic.phantom.phantom_bones import bones, joints
from handpipe.synthetic.phantom.phantom_muscles import KnownMuscle, ligaments, muscles
from handpipe.synthetic.phantom.phantom_skin import START, KnownSkin, nail_motion, nail_triangles
from handpipe.synthetic.phantom.phantom_tendons import tendons

Surface = tuple[Array, IntArray]

# MP2_flexion, MP2_abduction, PIP2_flexion, DIP2_flexion in degrees
POSES = {
    "neutral": (0, 0, 0, 0),
    "bow": (60, 0, 20, 10),
    "hook": (5, 0, 85, 45),
    "fist": (75, 0, 95, 55),
    "spread": (10, 15, 15, 5),
    "curl": (35, -12, 50, 25),
    "half": (45, 5, 40, 25),
    "reach": (20, -6, 65, 30),
}
ANGLES = ("MP2_flexion", "MP2_abduction", "PIP2_flexion", "DIP2_flexion")
BONE_SPACING = 0.7  # mm of the grid that bones are contoured on
SKIN_SPACING, SKIN_SIDES = 0.9, 72  # mm and 1: between rings of vertices; vertices of a ring
VISIBLE_FROM = START + 4.0  # mm, x where tendons begin to show in the images


class Finger:
    """The anatomy in the neutral pose, which `posed` puts in any other."""

    def __init__(self) -> None:
        self.known_bones = bones()
        shapes = {name: bone.whole for name, bone in self.known_bones.items()}
        self.shapes = shapes
        self.bones = {n: b.surface(b.whole, BONE_SPACING) for n, b in self.known_bones.items()}
        self.marrow = {n: b.surface(b.marrow, BONE_SPACING) for n, b in self.known_bones.items()}
        self.muscles = muscles([shapes["metacarpal2"], shapes["proximal2"]])
        self.ligaments = ligaments()
        self.tendons = tendons()
        self.skin = KnownSkin(self.muscles)
        self.skin_surface = self.skin.surface(SKIN_SPACING, SKIN_SIDES)
        self.nail = nail_triangles(*self.skin_surface)

    def posed(self, posture: Posture) -> PosedAnatomy:
        """All organs in a posture."""
        transforms = posture.transforms()
        muscle_poses = {name: muscle.pose(posture) for name, muscle in self.muscles.items()}
        growth = {name: pose[2] for name, pose in muscle_poses.items()}
        paths = {name: tendon.path(posture, self.shapes) for name, tendon in self.tendons.items()}
        skin, triangles = self.skin_surface
        return PosedAnatomy(
            posture,
            transforms,
            {n: (transforms[n](v), f) for n, (v, f) in self.bones.items()},
            {n: (transforms[n](v), f) for n, (v, f) in self.marrow.items()},
            {n: pose[:2] for n, pose in muscle_poses.items()},
            {n: ligament.pose(posture) for n, ligament in self.ligaments.items()},
            {n: tendon.centreline(paths[n]) for n, tendon in self.tendons.items()},
            {n: sweep(_visible(paths[n], posture), self.tendons[n].radius) for n in paths},
            {n: tendon.radius for n, tendon in self.tendons.items()},
            (self.skin.pose(skin, posture, growth), triangles),
            {"nail2": (self.nail, transforms["distal2"] @ nail_motion(posture))},
        )


def _visible(path: Array, posture: Posture) -> Array:
    """The part of a tendon's path that an image shows, every millimetre."""
    return path[posture.root.inverse()(path)[:, 0] > VISIBLE_FROM][::4]


@cache
def finger() -> Finger:
    """The one phantom finger."""
    return Finger()


def posture(pose: str, seed: int) -> Posture:
    """Posture of a named pose; the root is repositioned by up to 5 degrees and 6 mm in all but neutral."""
    if pose not in POSES:
        known = ", ".join(POSES)
        raise InputError("phantom-finger", f"poses.{pose}", "is not a pose of the phantom", f"Use {known}")
    angles = dict(zip(ANGLES, np.radians(POSES[pose]), strict=True))
    root = RigidTransform.identity() if pose == "neutral" else repositioning(seed, pose)
    return Posture(joints(), angles, root)


def generate_pose(dataset: Dataset, pose: str, *, spacing: float = 0.8, margin: float = 6.0) -> None:
    """Write a pose's volume, seeds, scan, truth and label volumes where the dataset names them.

    `spacing` is the voxel size and `margin` the air around the finger, in mm.

    Raises
    ------
    InputError
        For an unknown pose.
    """
    posed = finger().posed(posture(pose, dataset.seed))
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 4])
    write_pose(dataset, pose, posed, skin_scan(posed, rng), spacing=spacing, margin=margin)


def skin_scan(posed: PosedAnatomy, rng: np.random.Generator) -> Surface:
    """Scan of the posed skin, sampled elsewhere than the truth's mesh."""
    anatomy = finger()
    neutral, triangles = anatomy.skin.surface(0.83, 80, phase=0.4)
    growth = {name: muscle.pose(posed.posture)[2] for name, muscle in anatomy.muscles.items()}
    return scans.scan(
        neutral, anatomy.skin.pose(neutral, posed.posture, growth), triangles, rng, open_before=START + 7.0
    )


TEMPLATE_WARP = generic_hand.Distortion(
    np.array([60.0, 0.0, 0.0]),
    frame=RigidTransform(
        Rotation.from_euler("xyz", [5.0, -4.0, 6.0], degrees=True).as_matrix(), np.array([8.0, -5.0, 4.0])
    ),
)


def generate_templates(dataset: Dataset) -> None:
    """Write what a person brings to a subject: templates, attachments, tendon curves, the nail's patch."""
    anatomy = finger()
    write_templates(dataset, anatomy.muscles, anatomy.skin_surface, anatomy.nail)


def write_templates(
    dataset: Dataset, muscles: Mapping[str, KnownMuscle], skin: Surface, nail: IntArray
) -> None:
    """Write templates, attachments, tendon curves and the nail's patch, the triangles `nail` of a skin."""
    anatomy, rng = finger(), np.random.default_rng([dataset.seed, 3])
    neutral = posture("neutral", dataset.seed)
    for name, bone in dataset.bones.items():
        if bone.template is not None:
            known = anatomy.known_bones[name]
            vertices, triangles = known.surface(known.whole, 0.93)
            write_surface(dataset.path(bone.template), TEMPLATE_WARP(vertices), triangles)
    tubes = {n: m.surface(30, 20, 0.37) for n, m in muscles.items()}
    ends = dict.fromkeys(tubes, ("metacarpal2", "proximal2"))
    bands = {n: band.surface(18, 16, 0.37) for n, band in anatomy.ligaments.items()}
    ends |= dict.fromkeys(bands, ("proximal2", "middle2"))
    for name, entry in {**dataset.muscles, **dataset.ligaments}.items():
        vertices, triangles = {**tubes, **bands}[name]
        first, last = generic_hand.end_vertices(vertices, triangles)
        factor = 1.15 if name in tubes else 1.1
        warped = TEMPLATE_WARP(generic_hand.inflate(vertices, factor))
        write_surface(dataset.path(entry.template), warped, triangles)
        attachments = dict(zip(ends[name], (first, last), strict=True))
        generic_hand.write_attachments(dataset.path(entry.attachments), attachments)
    for name, tendon in dataset.tendons.items():
        line = anatomy.tendons[name].centreline(anatomy.tendons[name].path(neutral, anatomy.shapes))
        clicked = line[np.linspace(0, len(line) - 1, 8).astype(int)] + 0.3 * rng.standard_normal((8, 3))
        generic_hand.write_curve(dataset.path(tendon.path), clicked, name)
    used, patch = np.unique(skin[1][nail], return_inverse=True)
    for entry_of_nail in dataset.nails.values():
        write_surface(dataset.path(entry_of_nail.surface), skin[0][used], patch.reshape(-1, 3))
