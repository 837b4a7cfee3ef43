"""Wrists with known motions and bright marrow in dark shells: volumes and strokes as a person has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import nibabel
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.imaging.volumes import write_segments
from handpipe.synthetic.acquisition import image, seeds

SPACING, MARGIN = 0.7, 8.0  # mm
SHELL = 1.2  # mm
LEVELS = {"muscle": 0.45, "shell": 0.08, "marrow": 1.0}
NOISE = 0.02
WIDTH = 3.0  # mm up to which distances are needed


@dataclass(frozen=True)
class Turn:
    """A bone's turn in a pose against its parent: a rotation vector in deg about a centre in mm."""

    parent: str
    centre: tuple[float, float, float]
    degrees: Mapping[str, tuple[float, float, float]]

    def motion(self, pose: str) -> RigidTransform:
        """Of the pose; none in neutral."""
        turn = Rotation.from_rotvec(self.degrees.get(pose, (0.0, 0.0, 0.0)), degrees=True)
        return RigidTransform.about(np.array(self.centre), turn.as_matrix())


@dataclass(frozen=True)
class Wrist:
    """Neutral bones in mm, in the order of their labels, and what turns them; each after its parent."""

    bones: Mapping[str, trimesh.Trimesh]
    turns: Mapping[str, Turn]
    poses: tuple[str, ...]

    def motions(self, pose: str) -> dict[str, RigidTransform]:
        """From neutral into the pose by bone; the first bone lies still."""
        found: dict[str, RigidTransform] = {}
        for bone in self.bones:
            turn = self.turns.get(bone)
            found[bone] = (
                RigidTransform.identity() if turn is None else found[turn.parent] @ turn.motion(pose)
            )
        return found

    def write(self, folder: Path) -> None:
        """Volumes of all poses, and a segmentation with strokes of neutral."""
        folder.mkdir()
        for number, pose in enumerate(self.poses):
            random = np.random.default_rng(number)
            moved = {b: motion(self.bones[b].vertices) for b, motion in self.motions(pose).items()}
            grid = image.VoxelGrid.around(np.concatenate([*moved.values()]), MARGIN, SPACING)
            distances = [
                image.signed_distance((points, np.asarray(self.bones[b].faces, np.int64)), grid, WIDTH)
                for b, points in moved.items()
            ]
            values = np.full(grid.shape, LEVELS["muscle"])
            for tissue, depth in (("shell", 0.0), ("marrow", SHELL)):
                for distance in distances:
                    share = np.clip(0.5 - (distance + depth) / SPACING, 0.0, 1.0)
                    values += share * (LEVELS[tissue] - values)
            values = np.abs(values + NOISE * random.standard_normal(grid.shape))
            nibabel.save(
                nibabel.Nifti1Image(values.astype(np.float32), grid.affine), folder / f"{pose}.nii.gz"
            )
            if pose == "neutral":
                whole, marrow = (
                    seeds.majority({n: (d < -depth).astype(float) for n, d in enumerate(distances, 1)})
                    for depth in (0.0, SHELL)
                )
                table = {b: n for n, b in enumerate(self.bones, 1)} | {"background": 255}
                strokes = seeds.scribble(marrow, whole, grid, random)
                write_segments(folder / "neutral-seeds.seg.nrrd", strokes, grid.affine, table)


def lump(middle: tuple[float, float, float], radii: tuple[float, float, float]) -> trimesh.Trimesh:
    """A bone without symmetry: an ellipsoid with dents and bumps, some tenths of its radii high."""
    mesh = trimesh.creation.icosphere(subdivisions=4)
    x, y, z = mesh.vertices.T
    height = 1.0 + 0.2 * x * y + 0.15 * y * z + 0.15 * z**3 + 0.1 * y**3
    return trimesh.Trimesh(mesh.vertices * height[:, None] * radii + middle, mesh.faces)


def made_up() -> Wrist:
    """Radius, a lunate that turns about all axes, and an ulna that lies still beside the radius."""
    bones = {
        "radius": lump((-18.0, 4.0, 0.0), (16.0, 8.0, 7.0)),
        "lunate": lump((7.8, 2.0, 0.0), (8.0, 7.5, 6.5)),
        "ulna": lump((-18.0, -13.0, 0.0), (15.0, 7.0, 6.0)),
    }
    turns = {
        "flexed": (0.0, 28.0, 0.0),
        "extended": (3.0, -24.0, 4.0),
        "deviated": (-14.0, 2.0, 18.0),
    }
    return Wrist(bones, {"lunate": Turn("radius", CENTRE, turns)}, ("neutral", *turns))


CENTRE = (5.0, 2.0, 0.5)  # mm, of the lunate's turns
