"""Where parts of a limb touch: told by the bones, by the dark line between them, and by the neutral skin.

Between two fingers that touch the image shows no air. Every voxel of the body goes to a bone: the watershed
of the distance to the bones, raised where the image is dark, ends at the skin's line, and half-way where
there is none. The faces between two bones' voxels are a contact only where the bones are parts with skin
between them: in a bent pose where the neutral skin lies there, moved by either bone, and faces the other
bone; in neutral itself between digits beyond the web.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage.segmentation import watershed

from handpipe.core import Array, BoolArray, IntArray, RigidTransform
from handpipe.imaging.skin.body_voxels import BodyInVolume
from handpipe.imaging.volumes.rasterisation import rasterise
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Distance, Surface

DARK_LINE = 4.0  # mm, how far off half-way a line without signal moves the border between two bones
CORTEX = 1.5  # mm around a bone, where its own shell is dark
NEAR_SKIN = 3.0  # mm from the neutral skin, moved by a bone, at which a contact lies
FACING = 0.3  # cosine between a skin's normal and the way to the other bone
WEB = 0.5  # of a digit's first free bone, from its base: fingers are one there
AROUND = 2.0  # voxels, within which places of a contact are averaged
FEW = 12  # faces: fewer are no contact


@dataclass(frozen=True)
class PosedBones:
    """The bones of a pose, which tell parts that touch apart.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        Closed surface of each bone, in world mm of the pose's image.
    joints : collection of (str, str)
        Parent and child of each joint.
    motions : mapping of str to RigidTransform
        Transform of each bone from the neutral image; not needed in neutral.
    neutral : Surface, optional
        Skin of neutral, in mm of the neutral image. Without it digits are told apart beyond the web.
    """

    surfaces: Mapping[str, Surface]
    joints: Collection[tuple[str, str]]
    motions: Mapping[str, RigidTransform] = field(default_factory=dict)
    neutral: Surface | None = None

    def digits(self) -> list[list[str]]:
        """Chains of bones from the bone after the last fork to the tip, in order outwards."""
        children: dict[str, list[str]] = {}
        for parent, child in self.joints:
            children.setdefault(parent, []).append(child)
        parents = {child: parent for parent, child in self.joints}
        found = []
        for tip in (bone for bone in self.surfaces if bone not in children and bone in parents):
            chain = [tip]
            while chain[0] in parents and len(children[parents[chain[0]]]) == 1:
                chain.insert(0, parents[chain[0]])
            found.append(chain)
        return found


@dataclass(frozen=True)
class Contacts:
    """Where parts touch.

    Parameters
    ----------
    gap : array (nx, ny, nz) of bool
        Voxels that are taken out of the body to part it.
    places : array (k, 3)
        Places on the contacts, in world mm.
    """

    gap: BoolArray
    places: Array

    @staticmethod
    def none(volume: Volume) -> Contacts:
        """No contacts."""
        return Contacts(np.zeros(volume.shape, bool), np.zeros((0, 3)))

    @staticmethod
    def find(volume: Volume, body: BodyInVolume, bones: PosedBones) -> Contacts:
        """The contacts in the image of a pose."""
        names = list(bones.surfaces)
        marks = rasterise(volume, dict(enumerate(bones.surfaces.values(), 1)))
        marks = np.where(body.inside, marks, 0)
        owner = _owners(volume, body, marks)
        joined = [(names.index(a) + 1, names.index(b) + 1) for a, b in bones.joints if {a, b} <= set(names)]
        faces = _faces(owner, joined)
        places = volume.to_world((faces.first + faces.second) / 2)
        rule = _beyond_webs if bones.neutral is None else _between_skins
        kept = np.flatnonzero(rule(bones, names, faces, places))
        if len(kept) < FEW:
            return Contacts.none(volume)
        gap = np.zeros(volume.shape, bool)
        second = np.zeros(volume.shape, bool)
        second[tuple(faces.second[kept].T)] = True
        for low in np.unique(faces.owners[kept, 0]):
            others = np.unique(faces.owners[kept][faces.owners[kept, 0] == low, 1])
            gap |= (owner == low) & ndimage.binary_dilation(
                second & np.isin(owner, others), np.ones((3, 3, 3))
            )
        return Contacts(gap, _averaged(places[kept], AROUND * float(volume.spacing.mean())))


@dataclass(frozen=True)
class _Faces:
    """Faces between voxels of two bones that no joint joins; the bone of the smaller number is first."""

    first: IntArray  # (k, 3) voxels
    second: IntArray
    owners: IntArray  # (k, 2)


def _owners(volume: Volume, body: BodyInVolume, marks: NDArray[np.uint8]) -> IntArray:
    """The bone (nx, ny, nz) to which each voxel of the body goes."""
    distance = ndimage.distance_transform_edt(marks == 0, sampling=volume.spacing)
    dark = np.clip(1.0 - volume.values / np.maximum(body.tissue, 1e-6 * volume.bright), 0.0, 1.0)
    height = distance + DARK_LINE * dark * (distance > CORTEX)
    owner = watershed(height.astype(np.float32), marks.astype(np.int32), mask=body.inside)
    return np.asarray(owner)


def _faces(owner: IntArray, joined: Sequence[tuple[int, int]]) -> _Faces:
    count = int(owner.max()) + 1
    apart = np.ones((count, count), bool)
    for parent, child in joined:
        if max(parent, child) < count:
            apart[parent, child] = apart[child, parent] = False
    apart[0] = apart[:, 0] = False
    np.fill_diagonal(apart, False)
    first, second = [], []
    for axis in range(3):
        low = np.take(owner, np.arange(owner.shape[axis] - 1), axis)
        high = np.take(owner, np.arange(1, owner.shape[axis]), axis)
        at = np.argwhere((low != high) & apart[low, high])
        first.append(at)
        second.append(at + np.eye(3, dtype=np.int64)[axis])
    a, b = (np.concatenate(side).astype(np.int64) for side in (first, second))
    owners = np.stack([owner[tuple(a.T)], owner[tuple(b.T)]], axis=1)
    turned = owners[:, 0] > owners[:, 1]
    a[turned], b[turned] = b[turned], a[turned]
    return _Faces(a, b, np.sort(owners, axis=1))


def _ways(bones: Sequence[Surface], faces: _Faces, places: Array) -> Array:
    """Unit directions (k, 3) from the first bone to the second across each face."""
    ends = np.zeros((2, *places.shape))
    for side in (0, 1):
        for number in np.unique(faces.owners[:, side]):
            mine = faces.owners[:, side] == number
            vertices = bones[number - 1].vertices
            ends[side, mine] = vertices[cKDTree(vertices).query(places[mine])[1]]
    way = ends[1] - ends[0]
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9))


def _between_skins(bones: PosedBones, names: Sequence[str], faces: _Faces, places: Array) -> BoolArray:
    """Faces at which the neutral skin, moved by either bone, lies and faces the other bone."""
    assert bones.neutral is not None
    ways = _ways(list(bones.surfaces.values()), faces, places)
    distance = Distance(bones.neutral)
    normals = bones.neutral.triangle_normals()
    touching = np.ones(len(places), bool)
    for side, sign in ((0, 1.0), (1, -1.0)):
        for number in np.unique(faces.owners[:, side]):
            motion = bones.motions[names[number - 1]]
            mine = np.flatnonzero((faces.owners[:, side] == number) & touching)
            if len(mine) == 0:
                continue
            off, triangles, _ = distance.closest(motion.inverse()(places[mine]))[:3]
            facing = np.einsum("ij,ij->i", normals[triangles] @ motion.rotation.T, sign * ways[mine])
            touching[mine] = (off < NEAR_SKIN) & (facing > FACING)
    return touching


def _beyond_webs(bones: PosedBones, names: Sequence[str], faces: _Faces, places: Array) -> BoolArray:
    """Faces between two digits, beyond the web."""
    digit = np.full(len(names) + 1, -1)
    touching = np.ones(len(places), bool)
    for number, chain in enumerate(bones.digits()):
        for order, bone in enumerate(chain[1:], 1):
            digit[names.index(bone) + 1] = number
            if order == 1:
                at = (faces.owners == names.index(bone) + 1).any(axis=1)
                touching[at] &= _share_along(bones, chain, places[at]) > WEB
    of = digit[faces.owners]
    return touching & (of >= 0).all(axis=1) & (of[:, 0] != of[:, 1])


def _share_along(bones: PosedBones, chain: Sequence[str], places: Array) -> Array:
    """How far (k,) places lie along the second bone of a chain: 0 at its base, 1 at its head."""
    points = bones.surfaces[chain[1]].vertices
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    if axis @ (middle - bones.surfaces[chain[0]].vertices.mean(axis=0)) < 0:
        axis = -axis
    along = (points - middle) @ axis
    return np.asarray(((places - middle) @ axis - along.min()) / np.ptp(along))


def _averaged(places: Array, reach: float) -> Array:
    """Places without the voxels' steps: each the mean of those around it."""
    tree = cKDTree(places)
    return np.array([places[near].mean(axis=0) for near in tree.query_ball_point(places, reach)])
