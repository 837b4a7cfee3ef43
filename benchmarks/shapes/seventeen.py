"""Six poses of seventeen muscles, stages 2 and 3 of Zheng 2022 §4.4: seconds, and whether the bars are met.

Stage 1 is stood in for: muscles apart in neutral are carried into each pose by a manufactured map (the ray
turns, the belly shortens, thickens and bends) that lets them overlap, with smooth errors on top.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass

import numpy as np

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.packed_hand import packed_hand, turned_points
from benchmarks.shapes.separation import deepest
from handpipe.core import Array
from handpipe.mesh.generation import remesh, tetrahedralise
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import Embedding, TetMesh
from handpipe.tissues.muscles.fitting.pose_strains import KnownShape, PoseStrains, fit_pose_strains
from handpipe.tissues.muscles.muscle import TOUCHING
from handpipe.tissues.muscles.neighbours import touching
from handpipe.tissues.muscles.separation import separate

log = logging.getLogger("benchmarks.shapes")

EDGE = 1.1  # mm, for about the tets of Zheng 2022 Table 1: 6,566 a muscle
ERROR = 0.15  # mm, of stage 1, along the surface's normals
WAVE = 9.0  # mm, of that error


@dataclass(frozen=True)
class Pose:
    """turn: rad of the thumb's and the little finger's rays; shorter: share of its length by which a belly
    shortens at constant volume; bend: mm by which its middle moves towards the palm."""

    turn: float
    shorter: float
    bend: float

    @property
    def vector(self) -> Array:
        """(3,), neutral at the origin, in numbers of like size."""
        return np.array([self.turn, 2 * self.shorter, 0.1 * self.bend])


POSES = (
    Pose(0.05, 0.02, 0.4),
    Pose(0.10, 0.08, 1.0),
    Pose(0.15, 0.05, -0.5),
    Pose(0.20, 0.12, 1.5),
    Pose(0.25, 0.00, 0.8),
    Pose(0.12, 0.15, 0.0),
)


@dataclass(frozen=True)
class Carried:
    """A muscle's neutral surface in the tets that carry it."""

    surface: Surface
    mesh: TetMesh
    embedding: Embedding

    @staticmethod
    def build(surface: Surface, edge: float) -> Carried:
        mesh = tetrahedralise(remesh(surface, edge).largest_component(), 1.3 * edge)
        return Carried(surface, mesh, Embedding.embed(surface.vertices, mesh))


def in_pose(name: str, points: Array, centre: Array, pose: Pose) -> Array:
    """Points (n, 3) of a muscle, the middle of whose belly is `centre`, in a pose."""
    half = 26.0
    s = np.clip((points[:, 0] - centre[0]) / half, -1.0, 1.0)
    arch = np.cos(0.5 * np.pi * s) ** 2
    thicker = 1.0 + arch * (1.0 / np.sqrt(1.0 - pose.shorter) - 1.0)
    moved = centre + (points - centre) * np.column_stack(
        [np.full(len(s), 1 - pose.shorter), thicker, thicker]
    )
    moved[:, 2] -= pose.bend * arch
    if name.startswith("thenar"):
        return turned_points(moved, (-24, 18, 0), (0.3, 0.2, 1.0), pose.turn)
    if name.startswith("hypothenar"):
        return turned_points(moved, (-24, -24, 0), (1, 0, 0), -0.5 * pose.turn)
    return moved


def seen(surface: Surface, rng: np.random.Generator) -> Surface:
    """A surface as stage 1 leaves it: off along its normals by waves of random phases."""
    waves = rng.normal(size=(6, 3))
    waves *= 2 * np.pi / WAVE / np.linalg.norm(waves, axis=1, keepdims=True)
    phases = rng.uniform(0, 2 * np.pi, 6)
    offsets = ERROR * np.sqrt(2 / 6) * np.cos(surface.vertices @ waves.T + phases).sum(axis=1)
    return surface.moved(surface.vertices + offsets[:, None] * surface.vertex_normals())


def measure(count: int = len(POSES), edge: float = EDGE, muscles: int = 17) -> Figures:
    """`seventeen_…`: processor seconds of both stages, distances, penetration and eigenvalues."""
    poses = POSES[:count]
    rng = np.random.default_rng(0)
    packed, bones = packed_hand()
    rest = separate(dict(list(packed.items())[:muscles]), bones).surfaces
    bodies = {n: Carried.build(s, edge) for n, s in rest.items()}
    posed_bones = [packed_hand(pose.turn)[1] for pose in poses]
    begun = time.process_time()
    separated = []
    for number, pose in enumerate(poses):
        present = {}
        for name, surface in rest.items():
            moved = in_pose(name, surface.vertices, surface.vertices.mean(axis=0), pose)
            present[name] = seen(surface.moved(moved), rng)
        found = separate(present, posed_bones[number])
        log.info("pose %d: %.2f mm before", number, found.penetration_before)
        separated.append(found.surfaces)
    separation_seconds = time.process_time() - begun
    begun = time.process_time()
    fits = {name: fitted(name, body, poses, separated, posed_bones) for name, body in bodies.items()}
    strain_seconds = time.process_time() - begun
    carried = [
        {n: b.surface.moved(b.embedding(fits[n].vertices[k])) for n, b in bodies.items()}
        for k in range(len(poses))
    ]
    return {
        "seventeen_tets": figure(float(sum(len(b.mesh.tets) for b in bodies.values())), "1"),
        "seventeen_separation_seconds": figure(separation_seconds, "s"),
        "seventeen_strain_seconds": figure(strain_seconds, "s"),
        "seventeen_distance_max": figure(max(float(f.distances.max()) for f in fits.values()), "mm"),
        "seventeen_eigenvalue_min": figure(min(f.eigenvalues[0] for f in fits.values()), "1"),
        "seventeen_eigenvalue_max": figure(max(f.eigenvalues[1] for f in fits.values()), "1"),
        "seventeen_penetration_stage2": figure(max(map(deepest, separated, posed_bones)), "mm"),
        "seventeen_penetration_stage3": figure(max(map(deepest, carried, posed_bones)), "mm"),
    }


def fitted(
    name: str,
    body: Carried,
    poses: tuple[Pose, ...],
    separated: list[dict[str, Surface]],
    bones: list[dict[str, Surface]],
) -> PoseStrains:
    """Stage 3 of one muscle, from its neutral mesh under the poses' own maps."""
    near = [
        touching(s[name], [*(o for n, o in s.items() if n != name), *b.values()], TOUCHING)
        for s, b in zip(separated, bones, strict=True)
    ]
    centre = body.surface.vertices.mean(axis=0)
    starts = [in_pose(name, body.mesh.vertices, centre, pose) for pose in poses]
    fit = fit_pose_strains(
        body.mesh,
        body.embedding.matrix(len(body.mesh.vertices)),
        [
            KnownShape(s[name].vertices, start, ids)
            for s, start, ids in zip(separated, starts, near, strict=True)
        ],
        np.array([pose.vector for pose in poses]),
    )
    log.info("%s: %d tets, %.3f mm, gamma %.2g", name, len(body.mesh.tets), fit.distances.max(), fit.gamma)
    return fit
