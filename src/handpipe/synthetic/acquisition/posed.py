"""A posed subject with known truth, and the files of one pose of a dataset made of it."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform, artifacts
from handpipe.core.configuration import Dataset
from handpipe.synthetic.acquisition import image, seeds
from handpipe.synthetic.acquisition.imaged import imaged
from handpipe.synthetic.acquisition.physics import ImagedAnatomy
from handpipe.synthetic.geometry.kinematics import Posture

Surface = tuple[Array, IntArray]

PALM = np.array([0.0, 0.0, -1.0])  # from the back of a neutral hand to its palm


@dataclass(frozen=True)
class PosedAnatomy:
    """Every organ in one pose of a generated subject.

    Surfaces are (vertices, triangles); a nail is the skin's triangles on it and its transform from neutral.
    """

    posture: Posture
    transforms: dict[str, RigidTransform]
    bones: dict[str, Surface]
    marrow: dict[str, Surface]
    muscles: dict[str, Surface]
    ligaments: dict[str, Surface]
    tendons: dict[str, Array]
    tendon_tubes: dict[str, Surface]
    tendon_radii: dict[str, float]
    skin: Surface
    nails: dict[str, tuple[IntArray, RigidTransform]]


def repositioning(dataset_seed: int, pose: str) -> RigidTransform:
    """How the root lies in a pose's scan: turned by 2 to 5 degrees and moved by 2 to 6 mm."""
    rng = np.random.default_rng([dataset_seed, zlib.crc32(pose.encode()), 1])
    turn, shift = rng.standard_normal((2, 3))
    turn *= np.radians(rng.uniform(2.0, 5.0)) / np.linalg.norm(turn)
    shift *= rng.uniform(2.0, 6.0) / np.linalg.norm(shift)
    return RigidTransform(Rotation.from_rotvec(turn).as_matrix(), shift)


def write_pose(
    dataset: Dataset, pose: str, posed: PosedAnatomy, scan: Surface, *, spacing: float, margin: float
) -> None:
    """Write a pose's volume, seeds, scan, truth and label volumes where the dataset names them.

    `spacing` is the voxel size and `margin` the air around the finger, in mm.
    """
    files = dataset.poses[pose]
    grid = image.VoxelGrid.around(posed.skin[0], margin, spacing)
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 2])
    scanned = imaged(dataset, pose, anatomy_of(posed, grid), grid, rng)
    image.write_volume(dataset.path(files.volume), scanned.astype(np.float32), grid)

    labels = {name: bone.label for name, bone in dataset.bones.items()}
    whole = seeds.majority({labels[n]: image.occupancy(s, grid) for n, s in posed.bones.items()})
    marrow = seeds.majority({labels[n]: image.occupancy(s, grid) for n, s in posed.marrow.items()})
    if files.seeds is not None:
        image.write_volume(dataset.path(files.seeds), seeds.scribble(marrow, whole, grid, rng), grid)
    if files.scan is not None:
        write_surface(dataset.path(files.scan), *scan)
    if dataset.truth is not None:
        folder = dataset.path(dataset.truth.folder)
        image.write_volume(folder / f"{pose}.bones.nii.gz", whole, grid)
        image.write_volume(folder / f"{pose}.marrow.nii.gz", marrow, grid)
        write_truth(folder / f"{pose}.h5", posed)


def anatomy_of(posed: PosedAnatomy, grid: image.VoxelGrid) -> ImagedAnatomy:
    """What an image model takes of a posed subject."""
    root = next(iter(posed.transforms.values()))
    return ImagedAnatomy(layers(posed, grid), [*posed.bones.values()], root.rotation @ PALM)


def layers(posed: PosedAnatomy, grid: image.VoxelGrid) -> Iterator[tuple[str, Array]]:
    """The subject's tissues in paint order, and their shares of each voxel."""
    surfaces: dict[str, Iterable[Surface]] = {
        "fat": [posed.skin],
        "muscle": posed.muscles.values(),
        "ligament": posed.ligaments.values(),
        "tendon": posed.tendon_tubes.values(),
        "cortical": posed.bones.values(),
        "marrow": posed.marrow.values(),
    }
    for tissue, organs in surfaces.items():
        shares = (s for surface in organs for s in image.local_occupancy(surface, grid))
        yield tissue, image.total_share(shares, grid.shape)


def write_truth(path: Path, posed: PosedAnatomy) -> None:
    """Write the truth of a pose (kind "truth"); rotations and translations are from neutral into the pose."""

    def surface(s: Surface) -> dict[str, Any]:
        return {"vertices": s[0], "triangles": s[1]}

    def nail(triangles: IntArray, transform: RigidTransform) -> dict[str, Any]:
        used, patch = np.unique(posed.skin[1][triangles], return_inverse=True)
        moved = {"rotation": transform.rotation, "translation": transform.translation}
        return {**surface((posed.skin[0][used], patch.reshape(-1, 3))), **moved}

    data: dict[str, Any] = {
        "bones": {
            name: {
                "rotation": posed.transforms[name].rotation,
                "translation": posed.transforms[name].translation,
                **surface(posed.bones[name]),
                "marrow_vertices": posed.marrow[name][0],
                "marrow_triangles": posed.marrow[name][1],
            }
            for name in posed.bones
        },
        "muscles": {name: surface(s) for name, s in posed.muscles.items()},
        "ligaments": {name: surface(s) for name, s in posed.ligaments.items()},
        "tendons": {
            name: {"centreline": line, "radius": posed.tendon_radii[name]}
            for name, line in posed.tendons.items()
        },
        "skin": surface(posed.skin),
        "nails": {name: nail(*known) for name, known in posed.nails.items()},
        "angles": dict(posed.posture.angles),
        "joints": {j.name: {"axes": j.axes, "centre": j.centre} for j in posed.posture.joints},
    }
    units = {
        "bones": "mm",
        "muscles": "mm",
        "ligaments": "mm",
        "tendons": "mm",
        "skin": "mm",
        "angles": "rad",
    }
    artifacts.write(path, data, kind="truth", units=units)


def write_surface(path: Path, vertices: Array, triangles: IntArray) -> None:
    """Write a surface in mm as binary PLY, atomically."""
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    with artifacts.atomic(path) as temporary:
        mesh.export(temporary, file_type="ply")
