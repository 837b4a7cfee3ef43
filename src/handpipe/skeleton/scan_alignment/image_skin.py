"""The skin in the image of a pose, with the bones under it: what a scan is aligned to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, BoolArray, IntArray, RigidTransform
from handpipe.fem.linear import factorise
from handpipe.imaging.skin import VolumeSkin
from handpipe.mesh.surfaces import Surface, averaging
from handpipe.skeleton.rig.rig import Rig

POWER = 3.0  # of the distance to a bone, in a vertex's weights
ASIDE = 0.02  # weight of a bone outwards of a vertex, as a neighbouring finger's, against one inwards
DIFFUSION = 6.0  # square of the length, in edges, over which weights are smoothed along the skin


@dataclass(frozen=True)
class SkinHinge:
    """A joint of the image's skin: where its child's part of the skin may turn.

    Parameters
    ----------
    name : str
        Name of the joint.
    centre : array (3,)
        Centre in mm, in the pose's frame.
    axes : array (k, 3)
        Its axes as unit vectors in the pose's frame, from none to three.
    parent, child : int
        Numbers of its bones.
    """

    name: str
    centre: Array
    axes: Array
    parent: int
    child: int


def uncut(seen: VolumeSkin) -> BoolArray:
    """Vertices (n,) of the skin in a volume that are not on its flat ends."""
    kept = np.ones(len(seen.closed.vertices), dtype=bool)
    kept[seen.closed.triangles[seen.cut]] = False
    return kept


@dataclass(frozen=True)
class ImageSkin:
    """The skin in the image of a pose, with the bones and joints under it.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm, in the frame of the pose's volume.
    trusted : array (n,) of bool
        Vertices that are skin, and not where the image's border cuts the body.
    bones : mapping of str to Surface
        Bones in the pose, the root first, each after the bone that carries it.
    hinges : sequence of SkinHinge
        Joints between these bones, from the root outwards.
    """

    surface: Surface
    trusted: BoolArray
    bones: Mapping[str, Surface]
    hinges: Sequence[SkinHinge]

    @staticmethod
    def build(seen: VolumeSkin, rig: Rig, pose: str) -> ImageSkin:
        """The skin with the rig's bones and joints as it explains the pose.

        Bones whose place the pose does not determine are left out.

        Parameters
        ----------
        seen : VolumeSkin
            Skin in the pose's volume.
        rig : Rig
            The fitted rig.
        pose : str
            One of its scanned poses.

        Returns
        -------
        ImageSkin

        Raises
        ------
        InputError
            If the rig does not explain the pose.
        """
        root, known = rig.poses[pose].root if pose in rig.poses else None, rig.scanned_bones(pose)
        placed = {bone: (root or RigidTransform.identity()) @ t for bone, t in known.items()}
        names = [bone for bone in rig.bones if bone in placed]
        hinges = [
            SkinHinge(
                joint.name,
                placed[joint.parent](joint.fit.centre),
                joint.fit.axes.directions @ placed[joint.parent].rotation.T,
                names.index(joint.parent),
                names.index(joint.child),
            )
            for joint in rig.joints
            if joint.child in placed
        ]
        bones = {n: rig.surfaces[n].moved(placed[n](rig.surfaces[n].vertices)) for n in names}
        return ImageSkin(seen.closed, uncut(seen), bones, hinges)

    @cached_property
    def free(self) -> list[SkinHinge]:
        """Joints with at least one axis."""
        return [hinge for hinge in self.hinges if len(hinge.axes)]

    @cached_property
    def beyond(self) -> BoolArray:
        """Whether each bone (row) is moved by each free joint (column)."""
        parents = {hinge.child: hinge.parent for hinge in self.hinges}
        columns = {hinge.child: i for i, hinge in enumerate(self.free)}
        table = np.zeros((len(self.bones), len(self.free)), dtype=bool)
        for bone in range(len(self.bones)):
            if bone in parents:
                table[bone] = table[parents[bone]]
            if bone in columns:
                table[bone, columns[bone]] = True
        return table

    @cached_property
    def weights(self) -> Array:
        """Weight (n, bones) of each bone at each vertex; rows sum to one.

        Bones count by their distance, and hardly where they lie outwards of the skin: the next finger's bone
        may be nearer than the own one. Weights are smoothed along the skin.
        """
        normals = self.surface.vertex_normals()
        weights = np.empty((len(self.surface.vertices), len(self.bones)))
        for i, bone in enumerate(self.bones.values()):
            distances, nearest = cKDTree(bone.vertices).query(self.surface.vertices)
            inwards = np.einsum("ij,ij->i", self.surface.vertices - bone.vertices[nearest], normals)
            cosine = inwards / np.maximum(distances, 1e-9)
            weights[:, i] = (distances + 1.0) ** -POWER * np.clip(cosine, ASIDE, 1.0)
        weights /= weights.sum(axis=1, keepdims=True)
        return self._smoothed(weights)

    def _smoothed(self, weights: Array) -> Array:
        mean = averaging(self.surface)
        apart = sparse.identity(len(weights)) - 0.5 * (mean + mean.T)
        matrix = (sparse.identity(len(weights)) * (1 + 1e-9) + DIFFUSION * (apart.T @ apart)).tocsr()
        smooth = np.clip(factorise(matrix).solve(weights), 0.0, 1.0)
        return smooth / smooth.sum(axis=1, keepdims=True)

    @cached_property
    def joint_weights(self) -> Array:
        """Share (n, free joints) of each joint's motion that each vertex follows."""
        return self.weights @ self.beyond

    @cached_property
    def part(self) -> IntArray:
        """Number (n,) of the bone that each vertex follows most."""
        return self.weights.argmax(axis=1)
