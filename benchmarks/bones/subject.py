"""A part of the phantom hand under chosen conditions of its images: what a hard case is made of.

Bones, joints, motions and image model are those of the phantom hand; its other bones and tissues show in the
images, but nothing is asked of them.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from benchmarks.bones.misled import Seeding, mislead
from handpipe.core import Array, RigidTransform
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.imaging.volumes import Volume
from handpipe.imaging.volumes.volume import Labels
from handpipe.synthetic.acquisition import image, seeds
from handpipe.synthetic.acquisition.posed import PosedAnatomy
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.posed_hand import MIRROR, PosedHand, clean_image

Handedness = Literal["right", "left"]
DATASET = Path(__file__).parents[2] / "config" / "datasets" / "phantom-hand.yaml"
MARGIN = 9.0  # mm of the volume around the bones
PLUG = 2.0  # mm, radius of the marrow that joins two fused bones
NEUTRAL = "neutral"
FIVE = (NEUTRAL, "fist", "hook", "spread", "oppose_little")
TWELVE = (*FIVE, "flat", "bow", "oppose_index", "oppose_middle", "oppose_ring", "point", "relaxed")
# Axes about which the whole hand is turned by 120 degrees: the first only rolls long bones about themselves.
TURNS = ((1.0, 0.0, 0.0), (1.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0))


@dataclass(frozen=True)
class Part:
    """Bones of the phantom hand from the root outwards, each the parent of the next, and its poses."""

    bones: tuple[str, ...] = ("proximal2", "middle2", "distal2")
    poses: tuple[str, ...] = TWELVE

    def dataset(self, hand: Handedness = "right") -> Dataset:
        """The hand's dataset with these bones and poses alone; a left hand's axes turn the other way."""
        whole = load_dataset(DATASET).model_dump()
        poses = {name: {**whole["poses"][name], "role": "example"} for name in self.poses}
        poses[NEUTRAL]["role"] = "neutral"
        joints = {
            name: joint
            for name, joint in whole["joints"].items()
            if joint["parent"] in self.bones and joint["child"] in self.bones
        }
        if hand == "left":
            for joint in joints.values():
                joint["axis_hints"] = [tuple(-MIRROR * hint) for hint in joint["axis_hints"]]
        bones = {name: whole["bones"][name] for name in self.bones}
        part = {"bones": bones, "joints": joints, "poses": poses, "hand": hand}
        return Dataset.model_validate({**whole, **part})


PHALANGES = Part()
SMALL = Part(("middle2", "distal2"), (NEUTRAL, "hook", "spread"))


@dataclass(frozen=True)
class Conditions:
    """How one pose is imaged and seeded.

    spacing: voxel size in mm; slices: so many are averaged into one, across the palm; bias, noise: as the
    scanner's; turned: the hand lies turned by 120 degrees from neutral; fused: two bones whose marrow is
    joined; visible: share of the last bone's length, from its base, inside the volume; seeded: where the
    seeds of the bone `misled` lie.
    """

    spacing: float = 0.5
    slices: int = 1
    bias: float = 0.2
    noise: float = 0.03
    hand: Handedness = "right"
    turned: bool = False
    fused: tuple[str, str] | None = None
    visible: float = 1.0
    misled: str | None = None
    seeded: Seeding = "in marrow"


@dataclass(frozen=True, eq=False)
class Scan:
    """One pose as a person would give it, with the truth: bones and marrow as surfaces, and transforms."""

    volume: Volume
    seeds: Labels
    posed: PosedHand | PosedAnatomy
    labels: dict[str, int]

    @cached_property
    def field_of_view(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) of the volume in mm."""
        corners = np.array([[-0.5, -0.5, -0.5], np.array(self.volume.shape) - 0.5])
        low, high = self.volume.to_world(corners)
        return low, high


@cache
def scan(bones: tuple[str, ...], conditions: Conditions, pose: str) -> Scan:
    """Some bones of the phantom hand in a pose, imaged and seeded under the conditions."""
    dataset = Part(bones).dataset(conditions.hand)
    labels = {name: bone.label for name, bone in dataset.bones.items()}
    posed = _posed(conditions, pose, dataset.seed)
    grid = image.VoxelGrid.around(
        np.concatenate([posed.bones[n][0] for n in bones]), MARGIN, conditions.spacing
    )
    clean = _clean(posed, grid, conditions.fused)
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 2])
    drawn = _seeds(posed, grid, conditions, labels, rng)
    volume, drawn = _scanned(clean, drawn, grid, conditions, rng)
    if conditions.visible < 1.0:
        volume, drawn = _cut(volume, drawn, posed, bones[-1], conditions.visible)
    return Scan(volume, drawn, posed, labels)


def _posed(conditions: Conditions, pose: str, seed: int) -> PosedHand:
    posture = phantom_hand.posture(pose, seed)
    if conditions.turned and pose != NEUTRAL:
        axis = np.array(TURNS[TWELVE.index(pose) % len(TURNS)])
        turn = Rotation.from_rotvec(np.radians(120) * axis / np.linalg.norm(axis)).as_matrix()
        posture = replace(posture, root=RigidTransform(turn, np.zeros(3)) @ posture.root)
    posed = phantom_hand.hand().posed(posture)
    return posed.mirrored() if conditions.hand == "left" else posed


def _clean(posed: PosedHand, grid: image.VoxelGrid, fused: tuple[str, str] | None) -> Array:
    """Noise-free image; between two fused bones marrow goes from one into the other."""
    painted = clean_image(posed, grid)
    if fused is not None:
        ends = [_inner_end(posed, *fused), _inner_end(posed, *fused[::-1])]
        plug = trimesh.creation.cylinder(PLUG, segment=ends)
        share = image.local_occupancy((np.asarray(plug.vertices), np.asarray(plug.faces)), grid)
        image.paint_shares(painted, image.INTENSITIES["marrow"], share)
    return painted


def _inner_end(posed: PosedHand, bone: str, other: str) -> Array:
    """Middle (3,) of the end of a bone's marrow that is nearest to another bone's."""
    points = posed.marrow[bone][0]
    distance = np.linalg.norm(points - posed.marrow[other][0].mean(axis=0), axis=1)
    return points[distance <= np.quantile(distance, 0.15)].mean(axis=0)


def _scanned(
    clean: Array, drawn: Labels, grid: image.VoxelGrid, conditions: Conditions, rng: np.random.Generator
) -> tuple[Volume, Labels]:
    """The scanner's image, its slices averaged where asked, and the seeds on its grid."""
    n, affine = conditions.slices, grid.affine
    if n > 1:
        deep = clean.shape[2] // n
        clean = clean[:, :, : deep * n].reshape(*clean.shape[:2], deep, n).mean(axis=3)
        drawn = np.ascontiguousarray(drawn[:, :, : deep * n : n])
        affine[2, 3] += 0.5 * (n - 1) * grid.spacing
        affine[2, 2] *= n
    nx, ny, nz = clean.shape
    voxels = image.VoxelGrid((nx, ny, nz), grid.origin, grid.spacing)
    values, _, _ = image.acquire(clean, voxels, rng, bias=conditions.bias, noise=conditions.noise)
    return Volume(np.ascontiguousarray(values, dtype=np.float32), affine), drawn


def _seeds(
    posed: PosedHand,
    grid: image.VoxelGrid,
    conditions: Conditions,
    labels: dict[str, int],
    rng: np.random.Generator,
) -> Labels:
    """Scribbles as a person would draw them, right but for those of the bone that is misled."""
    whole = image.label_volume({labels[n]: posed.bones[n] for n in labels}, grid)
    marrow = image.label_volume({labels[n]: posed.marrow[n] for n in labels}, grid)
    drawn = seeds.scribble_locally(marrow, whole, grid, rng)
    if conditions.misled is not None:
        bones = list(labels)
        parent = bones[bones.index(conditions.misled) - 1]
        mislead(drawn, labels[conditions.misled], conditions.misled, parent, conditions.seeded, posed, grid)
    return drawn


def _cut(volume: Volume, drawn: Labels, posed: PosedHand, bone: str, visible: float) -> tuple[Volume, Labels]:
    """The volume ends at a share of a bone's extent along x; a bone of which nothing is left has no seeds."""
    x = posed.bones[bone][0][:, 0]
    edge = np.array([[x.min() + visible * np.ptp(x), 0.0, 0.0]])
    upper = np.array([int(volume.to_index(edge)[0, 0]), *volume.shape[1:]])
    return volume.crop(np.zeros(3, np.int64), upper), drawn[: upper[0]].copy()
