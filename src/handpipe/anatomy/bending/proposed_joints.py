"""Joints between bones of which nothing is known but their surfaces: which bones move, about which axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.rig import joint_point

AXES = ("bend", "sideways", "twist")  # turns about the axes of a joint
FRONT, UP = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])  # as the page's views have them
PARALLEL = 0.3  # sine of the angle between a bone and the front, below which `UP` is taken in its place
DEPTHS = np.linspace(-1.8, 1.8, 7)  # of a centre from the gap, in half thicknesses of the thinner bone
TRIED = np.radians([-60.0, -30.0, 30.0, 60.0])  # turns in which the gap of bones should change least
LEAST_GAP = 1e-6  # mm: a gap of zero would be no edge of the graph


@dataclass(frozen=True, eq=False)
class ProposedJoint:
    """The joint at which a bone moves.

    Parameters
    ----------
    parent : str
        Bone that stays.
    moving : tuple of str
        Bones that move with it: itself first, then those beyond it.
    centre : array (3,)
        Place in mm.
    axes : mapping of str to array (3,)
        Unit vectors by `AXES`. A positive bend of a limb along x goes to the back, a positive sideways turn
        to +y.
    """

    parent: str
    moving: tuple[str, ...]
    centre: Array
    axes: Mapping[str, Array]


def propose_joints(bones: Mapping[str, Surface], distal: Array) -> dict[str, ProposedJoint]:
    """The joint of each bone but the most proximal one.

    Bones are connected across the smallest gaps that join them all. The centre lies in the gap or beside it,
    where the gap changes least while the bone turns; `distal` and the front, which is +z, give the axes.

    Parameters
    ----------
    bones : mapping of str to Surface
        Closed surfaces in mm, apart from one another.
    distal : array (3,)
        Rough direction of the bones' distal ends.

    Returns
    -------
    dict of str to ProposedJoint
        Joints by the bone that moves; empty for a single bone.
    """
    parents = _parents(bones, np.asarray(distal, dtype=float))
    return {bone: _joint(bone, parents, bones) for bone in bones if parents[bone] is not None}


def _parents(bones: Mapping[str, Surface], distal: Array) -> dict[str, str | None]:
    """The bone nearer to the root that each bone is connected to; none of the root."""
    names = list(bones)
    trees = [cKDTree(bone.vertices) for bone in bones.values()]
    gaps = np.zeros((len(names), len(names)))
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        gaps[i, j] = max(float(trees[i].query(bones[names[j]].vertices)[0].min()), LEAST_GAP)
    edges = minimum_spanning_tree(sp.csr_matrix(gaps))
    root = int(np.argmin([bone.vertices.mean(axis=0) @ distal for bone in bones.values()]))
    before = breadth_first_order(edges, root, directed=False)[1]
    return {name: names[int(p)] if p >= 0 else None for name, p in zip(names, before, strict=True)}


def _joint(bone: str, parents: Mapping[str, str | None], bones: Mapping[str, Surface]) -> ProposedJoint:
    parent = parents[bone]
    assert parent is not None
    beyond = [name for name in parents if name != bone and _leads_to(name, bone, parents)]
    gap, middle = joint_point(bones[parent], bones[bone]), bones[bone].vertices.mean(axis=0)
    axes = _axes(middle - gap)
    centre = _steady_centre(bones[parent], bones[bone], gap, axes)
    return ProposedJoint(parent, (bone, *beyond), centre, axes)


def _leads_to(name: str, bone: str, parents: Mapping[str, str | None]) -> bool:
    """Whether a bone lies beyond another one."""
    above = parents[name]
    return above is not None and (above == bone or _leads_to(above, bone, parents))


def _axes(along: Array) -> dict[str, Array]:
    """Axes of the turns of a bone that goes along a direction (3,)."""
    twist = along / np.linalg.norm(along)
    across = np.cross(FRONT, twist)
    if np.linalg.norm(across) < PARALLEL:
        across = np.cross(UP, twist)
    bend = across / np.linalg.norm(across)
    return {"bend": bend, "sideways": np.cross(twist, bend), "twist": twist}


def _steady_centre(parent: Surface, child: Surface, gap: Array, axes: Mapping[str, Array]) -> Array:
    """The place (3,) on a line through the gap about which the gap changes least as the child bends."""
    thin = min(float(np.linalg.eigvalsh(np.cov(bone.vertices.T))[0]) for bone in (parent, child))
    distance = Distance(parent)
    rest = float(distance.signed(child.vertices)[0].min())
    places = gap - np.outer(DEPTHS * 2 * np.sqrt(thin), axes["twist"])
    turns = [Rotation.from_rotvec(angle * axes["bend"]).as_matrix() for angle in TRIED]

    def change(place: Array) -> float:
        moved = [RigidTransform.about(place, turn)(child.vertices) for turn in turns]
        return max(abs(float(distance.signed(points)[0].min()) - rest) for points in moved)

    return np.asarray(places[int(np.argmin([change(place) for place in places]))])
