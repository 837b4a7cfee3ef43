"""The index finger of real anatomy: its organs in any pose, and the files of a dataset made of it.

Bones are real surfaces, carved where they would enter one another in any of the poses; muscles are real
surfaces bent by fractions of the joint's motion, kept off their neighbours, at their neutral volume.
"""

from __future__ import annotations

import logging
import zlib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import igl
import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from handpipe.core import Array, InputError, IntArray, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.generation import implicit as grids
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.acquisition import image, sampled, scans
from handpipe.synthetic.acquisition.posed import PosedAnatomy, repositioning, write_pose, write_surface
from handpipe.synthetic.geometry import generic_hand
from handpipe.synthetic.geometry.implicit import Implicit, round_cone, smooth_union
from handpipe.synthetic.geometry.kinematics import Posture, ramp, smoothstep
from handpipe.synthetic.geometry.sliding import KnownTendon
from handpipe.synthetic.geometry.tubes import sweep, volume
from handpipe.synthetic.real_anatomy import zanatomy_source
from handpipe.synthetic.real_anatomy.source_meshes import folder_of

Surface = tuple[Array, IntArray]
log = logging.getLogger(__name__)

# MP2_flexion, MP2_abduction, PIP2_flexion, DIP2_flexion in degrees from the slightly bent neutral
POSES = {
    "neutral": (0, 0, 0, 0),
    "bow": (50, 0, 10, 5),
    "hook": (0, 0, 70, 40),
    "fist": (60, 0, 80, 45),
    "spread": (-8, 12, -8, 0),
    "curl": (30, -10, 45, 25),
    "half": (40, 4, 35, 20),
    "reach": (15, -5, 55, 30),
}
ANGLES = ("MP2_flexion", "MP2_abduction", "PIP2_flexion", "DIP2_flexion")
GAP = 0.3  # mm between bones
CORTEX = 1.1  # mm
BANDS = {"MP2": 17.0, "PIP2": 14.5, "DIP2": 10.5}  # mm before and behind a joint over which the skin bends
MUSCLE_BAND = 15.0  # mm before and behind a joint over which a muscle bends
SKIN_CLEARANCE = 0.9  # mm that the skin keeps from bones
ROUNDING = {"flexor2": 5.0, "extensor2": 2.5}  # mm
RADII = {"flexor2": 1.9, "extensor2": 1.1}


class IndexFinger:
    """The anatomy in the neutral pose, which `posed` puts in any other."""

    def __init__(self, folder: Path) -> None:
        self.source = zanatomy_source.read(folder)
        self.joints = self.source.joints
        self.shapes, self.bones, self.marrow = self._bones()
        self.tendons = self._tendons()
        self.muscles = self._muscles()
        self.skin = self._skin()
        self.nail = self._nail()

    def neutral(self) -> Posture:
        """The neutral posture: all angles zero, the root at the identity."""
        return Posture(self.joints, dict.fromkeys(ANGLES, 0.0), RigidTransform.identity())

    def _bones(self) -> tuple[dict[str, Implicit], dict[str, Surface], dict[str, Surface]]:
        """Distances, surfaces and marrow of the bones, carved so that they are apart in every pose."""
        whole = {name: sampled.of_surface(surface) for name, surface in self.source.bones.items()}
        postures = [Posture(self.joints, angles_of(pose), RigidTransform.identity()) for pose in POSES]
        shapes, bones, marrow = {}, {}, {}
        for name, (points, _) in self.source.bones.items():
            grid = grids.Grid.around(points, 3.0, 0.5)
            at = grid.points()
            values = whole[name](at)
            carved = values.copy()
            for joint in self.joints:
                if name in (joint.parent, joint.child):
                    other = joint.child if name == joint.parent else joint.parent
                    for posture in postures:
                        motion = joint.transform(posture.angles)
                        there = (motion.inverse() if name == joint.parent else motion)(at)
                        carved = np.maximum(carved, 0.5 * (values - whole[other](there) + GAP))
            log.info(
                "%s: carved by up to %.1f mm to keep bones apart", name, (carved - values)[values < 0.0].max()
            )
            volume_grid = image.VoxelGrid(grid.shape, grid.origin, grid.spacing)
            shapes[name] = sampled.interpolated(carved.reshape(grid.shape), volume_grid)
            bones[name] = _remeshed(grids.isosurface(carved, grid).largest_component(), 0.8)
            inside = grids.isosurface(shapes[name](at), grid, -CORTEX)
            marrow[name] = _remeshed(inside.largest_component(), 0.8)
        return shapes, bones, marrow

    def _tendons(self) -> dict[str, KnownTendon]:
        """Tendons whose length leaves their end inside the hand in every pose."""
        result = {}
        for name, side, line in (
            ("flexor2", -1.0, self.source.flexor),
            ("extensor2", 1.0, self.source.extensor),
        ):
            tendon = KnownTendon(name, side, RADII[name], line, 1.0, ROUNDING[name])
            paths = [
                tendon.path(Posture(self.joints, angles_of(pose), RigidTransform.identity()), self.shapes)
                for pose in POSES
            ]
            shortest = min(np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths)
            result[name] = replace(tendon, length=float(shortest) - 6.0)
        return result

    def _muscles(self) -> dict[str, Surface]:
        """Neutral muscles, off the bones, the tendons and one another."""
        obstacles = [*self.shapes.values(), *self._tendon_shapes(self.neutral())]
        result = _apart(self.source.muscles, obstacles)
        for name, (points, _) in result.items():
            moved = np.linalg.norm(points - self.source.muscles[name][0], axis=1)
            log.info(
                "%s: %d vertices pushed off neighbours, by up to %.2f mm",
                name,
                (moved > 0.01).sum(),
                moved.max(),
            )
        return result

    def _tendon_shapes(self, posture: Posture) -> list[Implicit]:
        return [sampled.of_line(t.path(posture, self.shapes), t.radius) for t in self.tendons.values()]

    def _skin(self) -> Surface:
        """Smooth closed surface a few mm around everything, cut before the metacarpal."""
        organs = [*self.bones.values(), *self.muscles.values()]
        lines = [(t.path(self.neutral(), self.shapes), t.radius) for t in self.tendons.values()]
        everything = np.concatenate([points for points, _ in organs])
        grid = grids.Grid.around(everything, 9.0, 1.0)
        at = grid.points()
        offsets = [2.2] * len(self.bones) + [2.0] * len(self.muscles)
        shapes = [
            _shifted(sampled.of_surface(surface, 0.6, 6.0), offset)
            for surface, offset in zip(organs, offsets, strict=True)
        ]
        shapes += [_shifted(sampled.of_line(line, radius), 1.8) for line, radius in lines]
        values = smooth_union([*shapes, *self._flesh()], 5.0)(at)
        cut = everything[:, 0].min() - 3.0
        values = -grids.smooth_minimum(-values, at[:, 0] - cut, 6.0)
        values = gaussian_filter(values.reshape(grid.shape), 1.5)
        return _remeshed(grids.isosurface(values, grid).largest_component(), 1.2)

    def _flesh(self) -> list[Implicit]:
        """Round cones along the bones for what the source lacks: fat, and the pulp of the fingertip."""
        base, tip = self.bones["metacarpal2"][0], self.bones["distal2"][0]
        nodes = [np.array([base[:, 0].min(), 0.0, 0.0]), *(joint.centre for joint in self.joints)]
        nodes.append(tip[np.argsort(tip[:, 0])[-30:]].mean(axis=0) - 3.0 * self.joints[-1].direction)
        palmar = np.array([0.0, 0.0, -1.2])
        radii = (11.5, 10.5, 8.8, 7.8, 6.6)
        return [
            round_cone(tuple(a + palmar), tuple(b + palmar), r, q)
            for a, b, r, q in zip(nodes[:-1], nodes[1:], radii[:-1], radii[1:], strict=True)
        ]

    def _nail(self) -> IntArray:
        """Indices of the skin's triangles on the back of the distal bone's outer part."""
        points, triangles = self.skin
        axis, dorsal = _distal_axes(self.bones["distal2"][0], self.joints[-1].axes[0])
        centre = self.bones["distal2"][0].mean(axis=0)
        local = points[triangles].mean(axis=1) - centre
        lateral = np.cross(dorsal, axis)
        along, across = local @ axis, local @ lateral
        normals = Mesh(points, triangles).triangle_normals() @ dorsal
        on = (
            (along > 0.0)
            & (along < 10.0)
            & (np.abs(across) < 4.8)
            & (normals > 0.35)
            & (local @ dorsal > 0.0)
        )
        return np.flatnonzero(on)

    def posed(self, posture: Posture) -> PosedAnatomy:
        """All organs in a posture."""
        transforms = posture.transforms()
        tendons = {name: tendon.path(posture, self.shapes) for name, tendon in self.tendons.items()}
        bone_shapes = [sampled.moved(shape, transforms[name]) for name, shape in self.shapes.items()]
        lines = [sampled.of_line(tendons[n], self.tendons[n].radius) for n in tendons]
        muscles = self._pose_muscles(posture, [*bone_shapes, *lines])
        obstacles = [*bone_shapes, *lines, *(sampled.of_surface(m) for m in muscles.values())]
        skin, triangles = self.skin
        bent = posture.bend(skin, self.fractions(skin, BANDS))
        return PosedAnatomy(
            posture,
            transforms,
            {n: (transforms[n](v), f) for n, (v, f) in self.bones.items()},
            {n: (transforms[n](v), f) for n, (v, f) in self.marrow.items()},
            muscles,
            {},
            {n: tendon.centreline(tendons[n]) for n, tendon in self.tendons.items()},
            {n: sweep(self._visible(tendons[n], posture), self.tendons[n].radius) for n in tendons},
            {n: tendon.radius for n, tendon in self.tendons.items()},
            (sampled.kept_off(bent, triangles, obstacles, SKIN_CLEARANCE), triangles),
            {"nail2": (self.nail, transforms["distal2"])},
        )

    def _visible(self, path: Array, posture: Posture) -> Array:
        """The part of a tendon's path that an image shows, every millimetre."""
        start = self.bones["metacarpal2"][0][:, 0].min() - 0.5
        return path[posture.root.inverse()(path)[:, 0] > start][::4]

    def fractions(self, points: Array, bands: dict[str, float]) -> dict[str, Array]:
        """How much of each joint's motion neutral points (n, 3) follow."""
        return {
            j.name: ramp(j.along(points), -bands[j.name], bands[j.name])
            for j in self.joints
            if j.name in bands
        }

    def _pose_muscles(self, posture: Posture, obstacles: list[Implicit]) -> dict[str, Surface]:
        """Muscles bent, kept off bones, tendons and one another, at their neutral volume."""
        result = {
            name: (posture.bend(points, self.fractions(points, {"MP2": MUSCLE_BAND})), triangles)
            for name, (points, triangles) in self.muscles.items()
        }
        for _ in range(5):
            result = _apart(result, obstacles, turns=1, rounds=4)
            for name, (points, triangles) in result.items():
                others = [sampled.of_surface(m, 0.5, 1.5) for n, m in result.items() if n != name]
                clear = np.minimum.reduce([shape(points) for shape in (*obstacles, *others)])
                grown = _grown(points, triangles, volume(*self.muscles[name]), smoothstep(clear, 0.3, 1.2))
                result[name] = grown, triangles
        return result


def _apart(
    muscles: Mapping[str, Surface], obstacles: list[Implicit], turns: int = 2, rounds: int = 8
) -> dict[str, Surface]:
    """Muscles kept off obstacles and, each in turn, off one another."""
    result = dict(muscles)
    for _ in range(turns):
        for name, (points, triangles) in result.items():
            others = [sampled.of_surface(m, 0.5, 1.5) for n, m in result.items() if n != name]
            result[name] = sampled.kept_off(points, triangles, [*others, *obstacles], 0.1, rounds), triangles
    return result


def _grown(points: Array, triangles: IntArray, target: float, share: Array) -> Array:
    """Points moved along their normals, each by its `share` (n,) of one length, towards a volume."""
    mesh = Mesh(points, triangles)
    areas = np.zeros(len(points))
    np.add.at(areas, triangles.ravel(), np.repeat(mesh.triangle_areas() / 3.0, 3))
    length = (target - volume(points, triangles)) / (areas @ share)
    return points + (length * share)[:, None] * mesh.vertex_normals()


def _remeshed(mesh: Mesh, edge_length: float) -> Surface:
    even = remesh(mesh, edge_length)
    return even.vertices, even.triangles


def _shifted(shape: Implicit, outwards: float) -> Implicit:
    return lambda points: shape(points) - outwards


def _distal_axes(points: Array, flexion: Array) -> tuple[Array, Array]:
    """The distal bone's long axis and its dorsal direction."""
    axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    axis *= np.sign(axis[0])
    dorsal = np.cross(axis, flexion)
    return axis, dorsal / np.linalg.norm(dorsal)


def angles_of(pose: str) -> dict[str, float]:
    """Joint angles of a named pose in rad."""
    if pose not in POSES:
        known = ", ".join(POSES)
        raise InputError("zanatomy-index", f"poses.{pose}", "is not a pose of this finger", f"Use {known}")
    return dict(zip(ANGLES, np.radians(POSES[pose]), strict=True))


@cache
def finger(folder: Path) -> IndexFinger:
    """The finger of an anatomy folder."""
    return IndexFinger(folder)


def _finger(dataset: Dataset) -> IndexFinger:
    return finger(folder_of(dataset))


def posture(dataset: Dataset, pose: str) -> Posture:
    """Posture of a named pose; the root is repositioned in all but neutral."""
    root = RigidTransform.identity() if pose == "neutral" else repositioning(dataset.seed, pose)
    return Posture(_finger(dataset).joints, angles_of(pose), root)


def generate_pose(dataset: Dataset, pose: str, *, spacing: float = 0.8, margin: float = 6.0) -> None:
    """Write a pose's volume, seeds, scan, truth and label volumes where the dataset names them.

    `spacing` is the voxel size and `margin` the air around the finger, in mm.

    Raises
    ------
    InputError
        For an unknown pose, or where the source anatomy is absent.
    """
    anatomy = _finger(dataset)
    posed = anatomy.posed(posture(dataset, pose))
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 4])
    write_pose(dataset, pose, posed, skin_scan(anatomy, posed, rng), spacing=spacing, margin=margin)


def skin_scan(anatomy: IndexFinger, posed: PosedAnatomy, rng: np.random.Generator) -> Surface:
    """Scan of the posed skin: points elsewhere on its triangles than their corners."""
    neutral, triangles = anatomy.skin
    other = remesh(Mesh(neutral, triangles), 0.95)
    _, faces, closest = igl.point_mesh_squared_distance(other.vertices, neutral, triangles)
    corners = triangles[faces]
    weights = igl.barycentric_coordinates(
        closest, *(np.ascontiguousarray(neutral[corners[:, i]]) for i in range(3))
    )
    on_skin = np.einsum("ni,nij->nj", weights, posed.skin[0][corners])
    start = anatomy.bones["metacarpal2"][0][:, 0].min() + 3.0
    return scans.scan(other.vertices, on_skin, other.triangles, rng, open_before=start)


TEMPLATE_WARP = generic_hand.Distortion(
    np.array([30.0, 0.0, 0.0]),
    frame=RigidTransform(
        Rotation.from_euler("xyz", [-4.0, 5.0, 5.0], degrees=True).as_matrix(), np.array([6.0, 7.0, -4.0])
    ),
)


def generate_templates(dataset: Dataset) -> None:
    """Write what a person brings to a subject: templates, attachments, tendon curves, the nail's patch."""
    anatomy, rng = _finger(dataset), np.random.default_rng([dataset.seed, 3])
    for name, bone in dataset.bones.items():
        if bone.template is not None:
            points, triangles = anatomy.source.bones[name]
            write_surface(dataset.path(bone.template), TEMPLATE_WARP(points), triangles)
    for name, entry in dataset.muscles.items():
        coarse = remesh(Mesh(*anatomy.source.muscles[name]), 1.0)  # coarser ones lose thin ends
        first, last = generic_hand.end_vertices(coarse.vertices, coarse.triangles, 0.1)
        warped = TEMPLATE_WARP(generic_hand.inflate(coarse.vertices, 1.15))
        write_surface(dataset.path(entry.template), warped, coarse.triangles)
        attachments = {"metacarpal2": first, "proximal2": last}
        generic_hand.write_attachments(dataset.path(entry.attachments), attachments)
    for name, tendon in dataset.tendons.items():
        known = anatomy.tendons[name]
        line = known.centreline(known.path(anatomy.neutral(), anatomy.shapes))
        clicked = line[np.linspace(0, len(line) - 1, 8).astype(int)] + 0.3 * rng.standard_normal((8, 3))
        generic_hand.write_curve(dataset.path(tendon.path), clicked, name)
    for nail in dataset.nails.values():
        vertices, triangles = anatomy.skin
        used, patch = np.unique(triangles[anatomy.nail], return_inverse=True)
        write_surface(dataset.path(nail.surface), vertices[used], patch.reshape(-1, 3))
