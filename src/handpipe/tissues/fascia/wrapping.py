"""The closed surface that a fascia wraps: bones with their joint spaces, or muscles (Zheng 2022 §6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handpipe.core import Array
from handpipe.mesh.generation import remesh, union_surface
from handpipe.mesh.surfaces import Distance, Surface, convex_hull
from handpipe.skeleton.posing import OPPOSED


def joint_faces(child: Surface, parent: Surface, threshold: float) -> Array:
    """Points of two bones that face one another across their joint (Wang 2019 §5.3, "sweeping"), (n, 3).

    threshold: distance in mm under which faces count as facing; their normals must oppose (dot < -0.7).
    """
    faces = []
    for bone, other in ((child, parent), (parent, child)):
        distance, _, closest, normals = Distance(other).signed(bone.vertices)
        facing = np.einsum("ni,ni->n", bone.vertex_normals(), normals) < OPPOSED
        near = facing & (distance < threshold)
        faces += [bone.vertices[near], closest[near]]
    return np.concatenate(faces)


def joint_hull(child: Surface, parent: Surface, threshold: float) -> Surface | None:
    """Convex hull of a joint's space, or None where the bones do not come near."""
    points = joint_faces(child, parent, threshold)
    return convex_hull(points) if len(points) >= 10 else None


def bone_wrap(
    bones: Mapping[str, Surface], joints: Sequence[tuple[str, str]], edge: float, threshold: float = 4.0
) -> Surface:
    """One closed surface of all bones and their joint spaces.

    Parameters
    ----------
    bones : mapping of str to Surface
        Neutral surfaces in mm.
    joints : sequence of (str, str)
        Parent and child bone of each joint.
    edge : float
        Edge length in mm.
    threshold : float
        Distance in mm under which faces of two bones that face one another bound their joint's space.

    Returns
    -------
    Surface
        Closed surface in mm, the largest piece where there are several.
    """
    hulls = [joint_hull(bones[child], bones[parent], threshold) for parent, child in joints]
    return wrap([*bones.values(), *(h for h in hulls if h is not None)], edge)


def wrap(bodies: Sequence[Surface], edge: float) -> Surface:
    """One closed surface around bodies.

    Parameters
    ----------
    bodies : sequence of Surface
        Surfaces in mm.
    edge : float
        Edge length in mm.

    Returns
    -------
    Surface
        Closed surface in mm, the largest piece where the bodies do not touch.
    """
    return remesh(union_surface(list(bodies), 0.5 * edge), edge).largest_component()
