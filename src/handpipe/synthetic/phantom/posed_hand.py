"""A posed hand of bones with known truth, its mirror image, and the files of one pose of it.

The truth is kinematic: closed-form motions of the joints. No code of the fitting pipeline is used. A left
hand is the mirror image of a right one: all is posed as a right hand and mirrored before it is imaged.
"""

from __future__ import annotations

import logging
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, InputError, IntArray, RigidTransform, artifacts
from handpipe.core.configuration import Dataset, Scanner
from handpipe.synthetic.acquisition import image
from handpipe.synthetic.acquisition.imaged import imaged
from handpipe.synthetic.acquisition.physics import ImagedAnatomy
from handpipe.synthetic.acquisition.posed import PALM, repositioning, write_surface
from handpipe.synthetic.geometry.kinematics import KnownJoint, Posture
from handpipe.synthetic.phantom import hand_tissue as tissue
from handpipe.synthetic.phantom.hand_tissue import Surroundings, Tissues
from handpipe.synthetic.phantom.phantom_hand_bones import WITH_ROOT

Surface = tuple[Array, IntArray]
LOG = logging.getLogger(__name__)

MARGIN = 13.0  # mm of the volume around the bones: soft tissue and some air
LEVELS = {**image.INTENSITIES, "cartilage": 0.55}  # of the painted image
MIRROR = np.array([1.0, -1.0, 1.0])  # signs of x, y and z of the other hand


@dataclass(frozen=True)
class PosedHand:
    """The hand in one pose: transforms from neutral, surfaces of whole bones and of their marrow, tissues."""

    joints: tuple[KnownJoint, ...]
    angles: dict[str, float]
    transforms: dict[str, RigidTransform]
    bones: dict[str, Surface]
    marrow: dict[str, Surface]
    tissues: Tissues

    def mirrored(self) -> PosedHand:
        """The same pose of the other hand, with the same angles."""

        def cones(rows: Array) -> Array:
            return rows * np.concatenate([MIRROR, MIRROR, [1.0, 1.0]])

        return PosedHand(
            tuple(mirrored_joint(j) for j in self.joints),
            self.angles,
            {n: mirrored_transform(t) for n, t in self.transforms.items()},
            {n: mirrored_surface(s) for n, s in self.bones.items()},
            {n: mirrored_surface(s) for n, s in self.marrow.items()},
            Tissues(*(cones(rows) for rows in vars(self.tissues).values())),
        )


def mirrored_surface(surface: Surface) -> Surface:
    """A surface in the mirror, facing outwards still."""
    return surface[0] * MIRROR, surface[1][:, ::-1].copy()


def mirrored_transform(transform: RigidTransform) -> RigidTransform:
    """The motion that a rigid motion has in the mirror: M T M."""
    return RigidTransform(transform.rotation * np.outer(MIRROR, MIRROR), transform.translation * MIRROR)


def mirrored_joint(joint: KnownJoint) -> KnownJoint:
    """The other hand's joint: its axes turn so that equal angles are mirror images of one another."""
    return KnownJoint(
        joint.name,
        joint.parent,
        joint.child,
        joint.angles,
        -joint.axes * MIRROR,
        joint.centre * MIRROR,
        -joint.residual_rotation * MIRROR,
        joint.residual_translation * MIRROR,
        joint.direction * MIRROR,
    )


@dataclass(frozen=True)
class Hand:
    """A right hand's anatomy in the neutral pose, which `posed` puts in any other."""

    bones: dict[str, Surface]
    marrow: dict[str, Surface]
    surroundings: Surroundings

    def posed(self, posture: Posture) -> PosedHand:
        """All bones and tissues in a posture."""
        moves = posture.transforms()
        return PosedHand(
            posture.joints,
            dict(posture.angles),
            moves,
            {n: (moves[n](v), f) for n, (v, f) in self.bones.items()},
            {n: (moves[n](v), f) for n, (v, f) in self.marrow.items()},
            self.surroundings.posed(moves),
        )


@dataclass(frozen=True)
class HandMotion:
    """The joints of a subject's hand and its poses: angles in degrees by pose and name."""

    subject: str
    joints: tuple[KnownJoint, ...]
    poses: Mapping[str, Mapping[str, float]]

    def posture(self, pose: str, seed: int) -> Posture:
        """Posture of a named pose; the root is repositioned by up to 5 degrees and 6 mm in all but neutral.

        Raises
        ------
        InputError
            For a pose that the subject does not have.
        """
        if pose not in self.poses:
            known = ", ".join(self.poses)
            raise InputError(self.subject, f"poses.{pose}", "is not a pose of this hand", f"Use {known}")
        root = RigidTransform.identity() if pose == "neutral" else repositioning(seed, pose)
        angles = {name: float(np.radians(value)) for name, value in self.poses[pose].items()}
        return Posture(self.joints, angles, root, WITH_ROOT)


def clean_image(posed: PosedHand, grid: image.VoxelGrid) -> Array:
    """Noise-free painted image of a posed hand."""
    return image.paint_layers(layers(posed, grid), LEVELS, grid)


def anatomy_of(posed: PosedHand, grid: image.VoxelGrid) -> ImagedAnatomy:
    """What an image model takes of a posed hand."""
    root = next(iter(posed.transforms.values()))
    return ImagedAnatomy(layers(posed, grid), [*posed.bones.values()], root.rotation @ PALM)


def layers(posed: PosedHand, grid: image.VoxelGrid) -> Iterator[tuple[str, NDArray]]:
    """The hand's tissues in paint order, and their shares of each voxel."""
    cones = posed.tissues
    inside = tissue.share_of_cones(cones.skin, grid, tissue.SKIN_BLEND)
    yield "fat", inside.astype(np.float64)
    for name, rows, blend in (
        ("muscle", cones.muscle, 2.0),
        ("cartilage", cones.cartilage, 1.0),
        ("ligament", cones.ligament, 0.0),
        ("tendon", cones.tendon, 0.0),
    ):
        yield name, np.minimum(tissue.share_of_cones(rows, grid, blend), inside)
    for name, surfaces in (("cortical", posed.bones), ("marrow", posed.marrow)):
        shares = (s for surface in surfaces.values() for s in image.local_occupancy(surface, grid))
        yield name, image.total_share(shares, grid.shape)


def volume_grid(bones: Mapping[str, Surface], names: Iterable[str], spacing: float) -> image.VoxelGrid:
    """The voxels of a pose's volume: around the named bones; whatever else reaches into it is cut off."""
    return image.VoxelGrid.around(np.concatenate([bones[n][0] for n in names]), MARGIN, spacing)


def write_pose(dataset: Dataset, pose: str, posed: PosedHand) -> None:
    """Write a pose's volume, truth and label volumes where the dataset names them; `seeds.draw` adds seeds.

    A left-handed dataset gets the mirror image of `posed`. A dataset with some of the bones alone is imaged
    around those; the others show and have no label.
    """
    files, scanner = dataset.poses[pose], dataset.scanner or Scanner()
    posed = posed.mirrored() if dataset.hand == "left" else posed
    grid = volume_grid(posed.bones, dataset.bones, scanner.spacing)
    LOG.info("%s: %d x %d x %d voxels of %g mm", pose, *grid.shape, grid.spacing)
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 2])
    scanned = imaged(dataset, pose, anatomy_of(posed, grid), grid, rng, levels=LEVELS, scanner=scanner)
    image.write_volume(dataset.path(files.volume), scanned.astype(np.float32), grid)
    labels = {name: bone.label for name, bone in dataset.bones.items()}
    whole = image.label_volume({label: posed.bones[n] for n, label in labels.items()}, grid)
    marrow = image.label_volume({label: posed.marrow[n] for n, label in labels.items()}, grid)
    if dataset.truth is not None:
        folder = dataset.path(dataset.truth.folder)
        image.write_volume(folder / f"{pose}.bones.nii.gz", whole, grid)
        image.write_volume(folder / f"{pose}.marrow.nii.gz", marrow, grid)
        write_truth(folder / f"{pose}.h5", posed)


def write_templates(dataset: Dataset, neutral: PosedHand) -> None:
    """Write the templates of bones that the dataset names: their own neutral surfaces."""
    posed = neutral.mirrored() if dataset.hand == "left" else neutral
    for name, bone in dataset.bones.items():
        if bone.template is not None:
            write_surface(dataset.path(bone.template), *posed.bones[name])


def write_truth(path: Path, posed: PosedHand) -> None:
    """Write the truth of a pose (kind "truth"); rotations and translations are from neutral into the pose."""
    data = {
        "bones": {
            name: {
                "rotation": posed.transforms[name].rotation,
                "translation": posed.transforms[name].translation,
                "vertices": vertices,
                "triangles": triangles,
                "marrow_vertices": posed.marrow[name][0],
                "marrow_triangles": posed.marrow[name][1],
            }
            for name, (vertices, triangles) in posed.bones.items()
        },
        "angles": dict(posed.angles),
        "joints": {j.name: {"axes": j.axes, "centre": j.centre} for j in posed.joints},
    }
    artifacts.write(path, data, kind="truth", units={"bones": "mm", "angles": "rad"})


def require_bones_alone(dataset: Dataset, known: Collection[str]) -> None:
    """Refuse what a hand of bones alone does not have: `InputError` that names it."""
    for kind in ("muscles", "ligaments", "tendons", "nails"):
        if getattr(dataset, kind):
            problem = "are not in this subject, which has bones alone"
            raise InputError(dataset.name, kind, problem, "Leave them out")
    for pose, files in dataset.poses.items():
        if files.scan is not None:
            problem = "is not made for this subject, which has no skin surface"
            raise InputError(dataset.name, f"poses.{pose}.scan", problem, "Leave it out")
    for name in dataset.bones:
        if name not in known:
            problem = "is not a bone of this subject"
            raise InputError(dataset.name, f"bones.{name}", problem, f"Its bones are {', '.join(known)}")
