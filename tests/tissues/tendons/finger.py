"""A manufactured finger: three straight bones, hinges about y, a tendon whose course is known."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from handpipe.core.arrays import Array
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.tendons.rods.rest import RestTendon
from handpipe.tissues.tendons.rods.rod import lay, resample
from handpipe.tissues.tendons.tendon import RegisteredRods, Tendon, build_tendon

BONES = ("distal", "middle", "base")  # from the insertion outwards
PARENTS = {"distal": "middle", "middle": "base"}
JOINTS = {"distal": 60.0, "middle": 30.0}  # x of the hinge at a bone's proximal end
RADIUS, DEPTH, SPACING = 1.3, 7.0, 1.2


def bone_surfaces() -> dict[str, Surface]:
    surfaces = {}
    for name, (start, end) in {"base": (-30, 29), "middle": (31, 59), "distal": (61, 85)}.items():
        made = trimesh.creation.box([end - start, 6.0, 6.0]).subdivide().subdivide()
        surfaces[name] = Surface(made.vertices + [(start + end) / 2, 0, 0], made.faces)
    return surfaces


def hinge(x: float, angle: float) -> RigidTransform:
    return RigidTransform.about(np.array([x, 0.0, 0.0]), Rotation.from_rotvec([0, angle, 0]).as_matrix())


def pose(middle: float, distal: float) -> dict[str, RigidTransform]:
    """Transforms from neutral for flexion angles in rad."""
    at_middle = hinge(JOINTS["middle"], middle)
    return {"base": RigidTransform.identity(), "middle": at_middle, "distal": at_middle @ hinge(60.0, distal)}


def course(middle: float, distal: float) -> Array:
    """The tendon's course (n, 3) on the extensor side, from x = 80 outwards: round each hinge on a circle."""
    bones = pose(middle, distal)
    pieces = []
    for name, joint, angle, start in (("distal", 60.0, distal, 80.0), ("middle", 30.0, middle, 60.0)):
        x = np.arange(start, joint, -0.1)
        pieces.append(bones[name](np.stack([x, 0 * x, 0 * x + DEPTH], axis=1)))
        parent = bones["middle"] if name == "distal" else bones["base"]
        turn = np.linspace(angle, 0, 40)
        arc = np.stack([joint + DEPTH * np.sin(turn), 0 * turn, DEPTH * np.cos(turn)], axis=1)
        pieces.append(parent(arc))
    x = np.arange(29.9, -30, -0.1)
    pieces.append(np.stack([x, 0 * x, 0 * x + DEPTH], axis=1))
    points = np.vstack(pieces)
    return points[np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9)]


def rest_tendon() -> RestTendon:
    x = resample(course(0.0, 0.0), SPACING)
    surfaces = bone_surfaces()
    return RestTendon.build(x, RADIUS, {name: surfaces[name] for name in BONES})


def true_rod(rest: RestTendon, middle: float, distal: float) -> Array:
    """The rod of the rest tendon's length along its course in a pose."""
    return lay(course(middle, distal), rest.length, len(rest.x) - 1, np.array([-1.0, 0, 0]))


def flexor_course(middle: float, distal: float, gap: float = 8.0) -> Array:
    """A flexor's course (n, 3), from x = 80 outwards: along the bones, and freely within `gap` of a hinge."""
    bones = pose(middle, distal)
    runs = []
    for name, start, end in (
        ("distal", 80, 60 + gap),
        ("middle", 60 - gap, 30 + gap),
        ("base", 30 - gap, -30),
    ):
        x = np.arange(start, end, -0.5)
        runs.append(bones[name](np.stack([x, 0 * x, 0 * x - DEPTH], axis=1)))
    pieces = [runs[0]]
    for before, after in zip(runs[:-1], runs[1:], strict=True):
        ends = np.stack([before[-1], after[0]])
        along = np.stack([before[-1] - before[-2], after[1] - after[0]])
        along *= np.linalg.norm(ends[1] - ends[0]) / np.linalg.norm(along, axis=1, keepdims=True)
        pieces += [CubicHermiteSpline([0, 1], ends, along)(np.linspace(0, 1, 40)[1:-1]), after]
    return np.vstack(pieces)


def flexor(examples: dict[str, tuple[float, float]]) -> Tendon:
    """A flexor fitted to its course in examples of flexion angles in rad, neutral among them."""
    surfaces = bone_surfaces()
    x = resample(flexor_course(0.0, 0.0), SPACING)
    rest = RestTendon.build(x, RADIUS, {name: surfaces[name] for name in BONES})
    end = np.array([-1.0, 0, 0])
    rods = {n: lay(flexor_course(*a), rest.length, len(x) - 1, end) for n, a in examples.items()}
    poses = {name: pose(*angles) for name, angles in examples.items()}
    return build_tendon("flexor", rest, RADIUS, surfaces, RegisteredRods(rods, poses, PARENTS))
