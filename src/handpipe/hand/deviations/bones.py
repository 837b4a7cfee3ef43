"""How far bones may be off: as registered in scanned poses, and as the rig takes them in others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.skeleton.bones import Registration
from handpipe.skeleton.posing import PoseSpace, left_out_weights, prediction_variance
from handpipe.skeleton.rig import Rig

Covariances = Mapping[str, Array]


@dataclass(frozen=True)
class JointDeviation:
    """How far a joint takes its child off, about the child's centroid.

    Parameters
    ----------
    parent, child : str
        Bones of the joint.
    angles : tuple of str
        Names of its angles.
    space : PoseSpace
        Its angles (rad) in the poses that it was fitted to, neutral first.
    fitted, open : array (2,)
        Mean squares of the turn (rad^2) and of the shift (mm^2): in the poses of the fit, and by unit of
        `prediction_variance` in poses that are left out of it.
    """

    parent: str
    child: str
    angles: tuple[str, ...]
    space: PoseSpace
    fitted: Array
    open: Array

    @staticmethod
    def learned(rig: Rig, joint: str, row: Mapping[str, Any]) -> JointDeviation:
        """From a joint's row of the rig's table, whose errors are means by pose."""
        known = next(j for j in rig.joints if j.name == joint)
        angles = np.vstack([np.zeros((1, known.fit.dof)), known.fit.angles.reshape(-1, known.fit.dof)])
        names = tuple(map(str, range(len(angles))))
        space = PoseSpace((known.parent, known.child), known.parent, angles, names, "rbf")
        unseen = [variance for _, _, variance in left_out_weights(space)]

        def squares(prefix: str) -> Array:
            turn, shift = (float(row.get(f"{prefix}FM_{c}", 0.0)) for c in "Rx")
            return np.array([np.radians(turn), shift]) ** 2

        usual = float(np.mean(unseen)) if unseen else 0.0
        more = squares("loo_") / usual if usual > 0 else np.zeros(2)
        return JointDeviation(known.parent, known.child, known.angles, space, squares(""), more)

    def variance(self, angles: Mapping[str, float], factor: float = 1.0) -> Array:
        """Mean squares (2,) of the turn in rad^2 and of the shift in mm^2 at given angles in rad.

        factor: of the deviation of what left-out poses are missed by.
        """
        pose = np.array([angles[name] for name in self.angles])
        return np.asarray(self.fitted + factor**2 * prediction_variance(self.space, pose) * self.open)

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {
            "parent": self.parent,
            "child": self.child,
            "angles": list(self.angles),
            "space": self.space.to_group(),
            "fitted": self.fitted,
            "open": self.open,
        }

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> JointDeviation:
        """What `to_group` gave, as an artifact returned it."""
        names = tuple(str(name) for name in group["angles"])
        space = PoseSpace.from_group(group["space"])
        return JointDeviation(
            str(group["parent"]), str(group["child"]), names, space, group["fitted"], group["open"]
        )


def scanned_covariances(
    rig: Rig, pose: str, registered: Mapping[str, Registration], bones: Mapping[str, RigidTransform]
) -> dict[str, Array]:
    """Covariances (6, 6) of the bones in a scanned pose: of a turn (rad) and a shift (mm) of the centroid.

    That of the registration, and the square of what the rig's bone is off the registered one. A bone that was
    not registered, or is in doubt, has none.

    Parameters
    ----------
    rig : Rig
        The rig.
    pose : str
        Name of the scanned pose.
    registered : mapping of str to Registration
        Its registrations by bone.
    bones : mapping of str to RigidTransform
        Its bones as the rig explains them, with the root at rest.

    Returns
    -------
    dict of str to array (6, 6)
        Covariances by bone.
    """
    found, root = {}, rig.poses[pose].root
    for bone, motion in bones.items():
        known = registered.get(bone)
        if known is None or known.doubt:
            continue
        seen = root.inverse() @ known.transform
        centroid = rig.surfaces[bone].vertices.mean(axis=0)[None]
        turn = (seen @ motion.inverse()).rotation_vector()
        off = np.concatenate([turn, (seen(centroid) - motion(centroid))[0]])
        # The covariance is in the axes of the scanner; the root is at rest here.
        axes = np.kron(np.eye(2), root.rotation.T)
        found[bone] = axes @ known.covariance @ axes.T + np.outer(off, off)
    return found


def posed_covariances(
    rig: Rig,
    joints: Sequence[JointDeviation],
    angles: Mapping[str, float],
    bones: Mapping[str, RigidTransform],
    factor: float = 1.0,
) -> dict[str, Array]:
    """The same at given angles (rad): the joints' errors from the root outwards, alike in all directions.

    Of the bones that the frame has.
    """
    placed = [bone for bone in rig.bones if bone in bones]
    centroids = {bone: bones[bone](rig.surfaces[bone].vertices.mean(axis=0)[None])[0] for bone in placed}
    found = {rig.root: np.zeros((6, 6))}
    known = {joint.child: joint for joint in joints}
    for bone, parent in rig.parents.items():
        if bone not in centroids or parent not in found:
            continue
        moved = lever(centroids[bone] - centroids[parent])
        found[bone] = moved @ found[parent] @ moved.T
        if bone in known:
            turn, shift = known[bone].variance(angles, factor)
            found[bone] = found[bone] + np.diag(np.repeat([turn / 3, shift / 3], 3))
    return found


def lever(arm: Array) -> Array:
    """Matrix (6, 6) from a turn and a shift of a point to those of another one, `arm` (3,) mm away."""
    found = np.eye(6)
    found[3:, :3] = -np.cross(np.eye(3), arm)
    return found


def variance_at(covariance: Array, arms: Array) -> Array:
    """Mean squares (n,) in mm^2 of the displacement of points at `arms` (n, 3) mm from the centroid."""
    turn, cross, shift = covariance[:3, :3], covariance[:3, 3:], covariance[3:, 3:]
    # |omega x a|^2 and 2 (omega x a) . t, each under its covariance.
    turned = (arms**2).sum(axis=1) * np.trace(turn) - np.einsum("ni,ij,nj->n", arms, turn, arms)
    twist = np.array([cross[2, 1] - cross[1, 2], cross[0, 2] - cross[2, 0], cross[1, 0] - cross[0, 1]])
    return np.maximum(turned + 2 * arms @ twist + np.trace(shift), 0.0)
