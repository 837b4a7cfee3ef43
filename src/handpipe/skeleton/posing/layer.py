"""The bones as the first layer of the simulation: rigid bodies at a frame's transforms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from handpipe.core import LAYERS, Array, Frame, InputError, IntArray, Region, Shape, Shapes
from handpipe.mesh.surfaces import Distance, Surface, about

SAME = 0.01  # mm beyond the nearest bone within which a vertex is of the region


def bone_regions(
    points: Array, bones: Mapping[str, Surface], joint_radius: float, tolerance: float
) -> IntArray:
    """Regions of points on bones: fixed on the bodies of bones, contact at heads and joints.

    A point is fixed if it lies on a bone and no other bone is near. The papers paint these regions by hand
    (Zheng 2022) or sweep the bones over the range of motion (Wang 2019).

    Parameters
    ----------
    points : array (n, 3)
        Points in the neutral frame, mm.
    bones : mapping of str to Surface
        Neutral bone surfaces, mm.
    joint_radius : float
        Distance in mm to a second bone up to which a point is in contact.
    tolerance : float
        Distance in mm up to which a point lies on a bone.

    Returns
    -------
    array (n,) of int
        `Region.fixed` or `Region.contact`.

    References
    ----------
    Zheng 2022 §6; Wang 2019 §5.4.
    """
    gaps = np.full((len(points), len(bones) + 1), np.inf)
    for column, bone in enumerate(bones.values()):
        near = about(points, bone, joint_radius + tolerance)
        gaps[near, column] = np.maximum(Distance(bone).signed(points[near])[0], 0.0)
    distances = np.sort(gaps, axis=1)
    fixed = (distances[:, 0] < tolerance) & (distances[:, 1] > joint_radius)
    return np.where(fixed, Region.fixed, Region.contact).astype(np.int64)


class BoneLayer:
    """The layer of the bones: neutral surfaces, moved rigidly.

    Parameters
    ----------
    bones : mapping of str to Surface
        Neutral bone surfaces in mm.
    joint_radius : float
        Distance in mm to a second bone up to which a vertex is in the region of contact.
    """

    name = "bones"
    needs = LAYERS[name].needs

    def __init__(self, bones: Mapping[str, Surface], joint_radius: float = 4.0) -> None:
        self.bones = dict(bones)
        points = np.concatenate([s.vertices for s in bones.values()])
        ends = np.cumsum([len(s.vertices) for s in bones.values()])
        regions = np.split(bone_regions(points, bones, joint_radius, SAME), ends[:-1])
        self.regions = dict(zip(bones, regions, strict=True))

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """Each bone's surface at its transform in a frame.

        Parameters
        ----------
        frame : Frame
            Frame with the transforms of all bones from neutral.
        below : mapping of str to Shapes
            Unused: the bones need no other layer.

        Returns
        -------
        Shapes
            Neutral and moved vertices (mm) by bone, with the region of each vertex.

        Raises
        ------
        InputError
            For a bone of which the frame has no transform.
        """
        for name in self.bones:
            if name not in frame.bones:
                source, remedy = f"frame {frame.name}", "Give the transform of every bone of the rig"
                raise InputError(source, f"bone {name}", "has no transform", remedy)
        return {
            name: Shape(
                s.vertices, frame.bones[name](s.vertices), s.triangles, {"region": self.regions[name]}
            )
            for name, s in self.bones.items()
        }


def load(_: Sequence[Path], bones: Mapping[str, Surface]) -> BoneLayer:
    """The layer of the bones' neutral surfaces."""
    return BoneLayer(bones)
