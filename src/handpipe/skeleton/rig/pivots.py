"""A rig without anatomy, for comparison: each bone turns about the head of its parent."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.joint_tree import Bones
from handpipe.skeleton.rig.rig import Rig

HEAD = 0.1  # share of the parent's vertices, nearest to the joint, that are its head


def pivoted(rig: Rig, bones: Bones) -> dict[str, RigidTransform]:
    """Motions of the bones by a rig whose joints are pivots at the parents' heads.

    Each bone keeps its rotation relative to its parent. Its translation is that of a turn about the centre of
    the parent's head.

    Parameters
    ----------
    rig : Rig
        Fitted rig: its tree and its neutral bones are used.
    bones : mapping of str to RigidTransform
        Motions of all bones of the rig from neutral, mm.

    Returns
    -------
    dict of str to RigidTransform
        Motions of the bones from neutral, mm.

    References
    ----------
    Wang 2019 §6, Fig. 16 and 20.
    """
    moved = {rig.root: bones[rig.root]}
    for joint in rig.joints:
        relative = bones[joint.parent].inverse() @ bones[joint.child]
        about = RigidTransform.about(head(rig.surfaces, joint.parent, joint.child), relative.rotation)
        moved[joint.child] = moved[joint.parent] @ about
    return moved


def head(surfaces: Mapping[str, Surface], parent: str, child: str) -> Array:
    """Centre (3,) in mm of the sphere that fits the parent's end towards the child best."""
    vertices = surfaces[parent].vertices
    distances = np.linalg.norm(vertices - surfaces[child].vertices.mean(axis=0), axis=1)
    end = vertices[distances <= np.quantile(distances, HEAD)]
    # |p - c|^2 = r^2 is linear in the centre c and in r^2 - |c|^2.
    origin = end.mean(axis=0)
    p = end - origin
    unknown = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), (p**2).sum(axis=1), rcond=None)[0]
    return np.asarray(origin + unknown[:3])
