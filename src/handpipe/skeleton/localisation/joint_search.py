"""Motions that a joint may have before any pose is known: trials for a search, and how plausible each is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.core.configuration import Dataset, Joint
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.hinted_axes import tilted_axes
from handpipe.skeleton.localisation.bone_probes import MovingBones
from handpipe.skeleton.localisation.motion_search import Motions
from handpipe.skeleton.rig.rig import joint_point

UNSTATED = ((-45.0, 110.0),)  # deg, of an angle whose limits are left to the data
WIDENED = np.radians(15.0)  # beyond the limits on either side
STEP = 2.5  # mm at the far end of the bone between two trials
DEPTHS = (-0.6, 0.0, 0.6, 1.2, 1.8)  # of the centre inside the parent, in half thicknesses of the child
ROLLS = np.radians([-22.0, 0.0, 22.0])  # by which a hinge may be off: a phalanx hardly shows its roll
OFF_AXES, BEYOND = (10.0, 32.0), (12.0, 35.0)  # deg: from where to where a motion loses its plausibility
USUAL_GAP, GAPING = 2.5, 4.0  # mm between bones of a joint; beyond the latter one of them lacks its end
CONTACT = 300  # vertices of the child that may touch the parent


@dataclass(frozen=True)
class Link:
    """A joint between two bodies, with what its search needs.

    Parameters
    ----------
    name : str
        Name of the joint.
    parent, child : int
        Numbers of the bodies.
    axes : Axes
        Axes of the dataset's hints.
    limits : array (dof, 2)
        Limits of the angles in rad.
    trials : Motions
        Motions of the child with the parent at rest.
    near : array (n, 3)
        Outer vertices of the child in mm.
    parent_surface : Distance
        Distances to the whole parent bone.
    neutral_gap : float
        Distance between the two bones in neutral, mm.
    """

    name: str
    parent: int
    child: int
    axes: Axes
    limits: Array
    trials: Motions
    near: Array
    parent_surface: Distance
    neutral_gap: float = 0.0

    @property
    def gapes(self) -> bool:
        """Whether the bones are so far apart in neutral that one of them must lack its end there."""
        return self.neutral_gap > GAPING

    def departure(self, parent: RigidTransform, child: RigidTransform) -> Departure:
        """How far a found motion is from what the joint can do."""
        relative = parent.inverse() @ child
        turn, beyond = self._departure(self.axes, relative.rotation)
        near = turn, beyond
        if near != (0.0, 0.0) and not Departure(turn, beyond, 0.0, turn).expected:
            tilted = (self._departure(axes, relative.rotation) for axes in tilted_axes(self.axes))
            near = min(tilted, key=sum)
        gap = float(self.parent_surface.closest(relative(self.near))[0].min())
        return Departure(turn, near[1], gap, near[0], self.neutral_gap)

    def _departure(self, axes: Axes, rotation: Array) -> tuple[float, float]:
        """Degrees that turns about the axes do not explain, and degrees beyond the limits."""
        angles = axes.nearest(rotation[None])[0]
        left = axes.rotation(angles).T @ rotation
        beyond = np.maximum(np.maximum(self.limits[:, 0] - angles, angles - self.limits[:, 1]), 0.0)
        return float(np.degrees(Rotation.from_matrix(left).magnitude())), float(np.degrees(beyond.max()))


@dataclass(frozen=True)
class Departure:
    """How far a joint's motion departs from what the joint allows.

    Attributes
    ----------
    turn : float
        Rotation in deg that the joint's hinted axes do not explain.
    beyond : float
        Rotation in deg beyond the limits.
    gap : float
        Gap in mm between the two bones.
    off : float
        Rotation in deg that no axes near the hinted ones explain (within 30 deg, as hints may be off).
    neutral_gap : float
        The gap in neutral, in mm.
    """

    turn: float
    beyond: float
    gap: float
    off: float
    neutral_gap: float = 0.0

    @property
    def plausible(self) -> float:
        """One for a motion that the joint can have, towards zero for one that it cannot.

        A gap that neutral has says nothing of this pose.
        """
        opened = self.gap - max(self.neutral_gap - USUAL_GAP, 0.0)
        return falling(self.off, *OFF_AXES) * falling(self.beyond, *BEYOND) * falling(opened, USUAL_GAP, 6)

    @property
    def expected(self) -> bool:
        """Whether nothing of the joint's turn speaks against it."""
        return self.off <= OFF_AXES[0] and self.beyond <= BEYOND[0]


def falling(value: float, good: float, bad: float) -> float:
    """One up to `good`, falling to zero at `bad`."""
    return float(np.clip((bad - value) / (bad - good), 0.0, 1.0))


def all_links(dataset: Dataset, whole: Mapping[str, Surface], bodies: list[MovingBones]) -> list[Link]:
    """The joints that move, each after the one that carries its parent."""
    body_of = {bone: i for i, body in enumerate(bodies) for bone in body.bones}
    left = {n: j for n, j in dataset.joints.items() if body_of[j.parent] != body_of[j.child]}
    reached, links = {0}, []
    while left:
        for name in [n for n, j in left.items() if body_of[j.parent] in reached]:
            joint = left.pop(name)
            child = body_of[joint.child]
            reached.add(child)
            links.append(_link(name, joint, whole, bodies, body_of[joint.parent], child))
    return links


def _link(
    name: str, joint: Joint, whole: Mapping[str, Surface], bodies: list[MovingBones], parent: int, child: int
) -> Link:
    hints = np.array(joint.axis_hints, float).reshape(-1, 3)
    axes = Axes(hints / np.linalg.norm(hints, axis=1, keepdims=True), tuple(range(len(hints))))
    limits = np.radians(np.array(joint.limits_deg or UNSTATED * len(hints), float)).reshape(-1, 2)
    surface = whole[joint.child]
    centres = _centres(whole[joint.parent], surface)
    trials = _trials(axes, limits, centres, bodies[child])
    if axes.dof == 1:
        along = (centres[-1] - centres[0]) / np.linalg.norm(centres[-1] - centres[0])
        rolls = [RigidTransform.about(centres[0], Rotation.from_rotvec(r * along).as_matrix()) for r in ROLLS]
        trials = Motions.joined([trials.seen_from(roll) for roll in rolls])
    near = surface.vertices[:: max(len(surface.vertices) // CONTACT, 1)]
    of_parent = Distance(whole[joint.parent])
    neutral_gap = float(of_parent.closest(near)[0].min())
    return Link(name, parent, child, axes, limits, trials, near, of_parent, neutral_gap)


def _centres(parent: Surface, child: Surface) -> Array:
    """Places (n, 3) where the joint's centre may be: about the gap, on a line from the child inwards."""
    gap, middle = joint_point(parent, child), child.vertices.mean(axis=0)
    thickness = 2 * np.sqrt(np.linalg.eigvalsh(np.cov(child.vertices.T))[0])
    inwards = (gap - middle) / np.linalg.norm(gap - middle)
    return gap + np.outer(np.array(DEPTHS) * thickness, inwards)


def _trials(axes: Axes, limits: Array, centres: Array, child: MovingBones) -> Motions:
    """Motions at all angles within the widened limits, about all centres."""
    reach = max(float(np.linalg.norm(child.probes.points - c, axis=1).max()) for c in centres)
    ranges = [
        np.linspace(a - WIDENED, b + WIDENED, int((b - a + 2 * WIDENED) * reach / STEP) + 2)
        for a, b in limits
    ]
    turns = [axes.rotation(np.array(angles)) for angles in product(*ranges)]
    return Motions.stack([RigidTransform.about(c, turn) for c in centres for turn in turns])
