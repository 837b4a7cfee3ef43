"""The faces of a bone over which its child glides in the whole range of a joint's motion."""

from __future__ import annotations

from itertools import product

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.mesh.surfaces import Distance
from handpipe.skeleton.joints.joint_tree import JointTree, RigJoint

FACING = 2.5  # mm between faces of a joint, whose space has no tets (Wang 2019 §5.3)
OPPOSED = -0.7  # largest cosine between normals that face one another


def swept_vertices(tree: JointTree, step: float) -> dict[str, BoolArray]:
    """Vertices of each bone that faces one of its children in some position of their joint.

    A child faces its parent where a vertex of it is within 2.5 mm of a triangle and their normals are
    opposed. Each joint moves alone, all of its angles over a grid between their limits.

    Parameters
    ----------
    tree : JointTree
        Joints with limits, and neutral bones.
    step : float
        Step of the angles in rad.

    Returns
    -------
    dict of str to array (n,) of bool
        Mask of the vertices of each bone.

    References
    ----------
    Wang 2019 §5.4.
    """
    swept = {name: np.zeros(len(bone.vertices), dtype=bool) for name, bone in tree.surfaces.items()}
    for joint in tree.joints:
        parent, child = tree.surfaces[joint.parent], tree.surfaces[joint.child]
        distance, normals = Distance(parent), child.vertex_normals()
        for angles in _grid(joint, step):
            moved = joint.fit.transform(angles)
            gaps, triangles, _, facing = distance.signed(moved(child.vertices))
            opposed = np.einsum("ni,ni->n", normals @ moved.rotation.T, facing) < OPPOSED
            near = opposed & (gaps < FACING)
            swept[joint.parent][parent.triangles[triangles[near]]] = True
    return swept


def _grid(joint: RigJoint, step: float) -> list[Array]:
    """All combinations of a joint's angles, by steps between limits."""
    axes = [np.linspace(low, high, 1 + int(np.ceil((high - low) / step))) for low, high in joint.limits]
    return [np.array(angles) for angles in product(*axes)]
