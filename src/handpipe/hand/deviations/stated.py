"""Stated deviations: how far each point of a simulated hand is expected to be off, in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from handpipe.core import Array, Frame, Shapes, artifacts
from handpipe.hand.deviations.body import BodyDeviation
from handpipe.hand.deviations.bones import (
    JointDeviation,
    posed_covariances,
    variance_at,
)
from handpipe.skeleton.rig import Rig
from handpipe.tissues.tendons import CENTRELINE

KIND = "deviations"
LITTLE = 0.01  # share of a bone in a point's motion below which it does not count


class Calibration(NamedTuple):
    """Of a kind of organ: factor of what the examples leave open; the images' noise as a share of a voxel."""

    factor: float
    floor: float


# Chosen on the generated finger (phantom-finger, voxels of 0.8 mm): floors in its example poses, factors in
# its held-out ones, on the side of larger deviations (docs/methods.md, Error bars).
CALIBRATIONS = {
    "bones": Calibration(0.7, 0.05),
    "tendons": Calibration(0.7, 0.05),
    "muscles": Calibration(0.7, 0.1),
    "skin": Calibration(0.7, 0.03),
}


@dataclass(frozen=True)
class HandDeviations:
    """What is stated of a hand: of its bones in scanned poses and others, and of each body on them.

    Parameters
    ----------
    bones : tuple of str
        Bones in the order of the rig.
    joints : tuple of JointDeviation
        The rig's joints that were fitted.
    scanned : mapping of str to mapping of str to array (6, 6)
        Covariances of bones in scanned poses, by pose and bone.
    bodies : mapping of str to BodyDeviation
        By name in the layers of a frame; a tendon's centreline stands for the tendon.
    voxel : float
        Size of the neutral image's voxels in mm.
    """

    bones: tuple[str, ...]
    joints: tuple[JointDeviation, ...]
    scanned: Mapping[str, Mapping[str, Array]]
    bodies: Mapping[str, BodyDeviation]
    voxel: float

    def of_bones(self, rig: Rig, frame: Frame, pose: str | None = None) -> dict[str, Array]:
        """Covariances (6, 6) by bone, of a turn (rad) and a shift of its centroid (mm), calibrated.

        Parameters
        ----------
        rig : Rig
            The rig.
        frame : Frame
            The frame, the root at rest.
        pose : str, optional
            The scanned pose that the frame shows; None where its angles alone are given.
        """
        factor, floor = CALIBRATIONS["bones"]
        found = posed_covariances(rig, self.joints, frame.angles, frame.bones, factor)
        if pose is not None:
            found |= self.scanned[pose]
        least = np.diag([0.0] * 3 + [(floor * self.voxel) ** 2 / 3] * 3)
        return {bone: c + least for bone, c in found.items()}

    def of_frame(
        self, rig: Rig, frame: Frame, layers: Mapping[str, Shapes], pose: str | None = None
    ) -> dict[str, dict[str, Array]]:
        """Deviations (n,) in mm of the points of bodies, by layer and body, of those that are known.

        Parameters
        ----------
        rig, frame, pose
            As for `of_bones`.
        layers : mapping of str to Shapes
            The frame's bodies by layer.
        """
        covariances = self.of_bones(rig, frame, pose)
        arms = {b: rig.surfaces[b].vertices.mean(axis=0)[None] for b in covariances}
        centroids = {b: frame.bones[b](c)[0] for b, c in arms.items()}
        found: dict[str, dict[str, Array]] = {}
        for layer, shapes in layers.items():
            for name, shape in shapes.items():
                if layer == "bones" and name in covariances:
                    squares = variance_at(covariances[name], shape.vertices - centroids[name])
                elif name in self.bodies:
                    known = self.bodies[name]
                    squares = self._of_body(known, frame, shape.vertices, covariances, centroids, pose)
                else:
                    continue
                found.setdefault(layer, {})[name] = np.sqrt(squares)
            for name in [n for n in shapes if n + CENTRELINE in found.get(layer, {})]:
                rod, stated = shapes[name + CENTRELINE].rest, found[layer][name + CENTRELINE]
                nearest = np.linalg.norm(shapes[name].rest[:, None] - rod[None], axis=2).argmin(axis=1)
                found[layer][name] = stated[nearest]
        return found

    def _of_body(
        self,
        known: BodyDeviation,
        frame: Frame,
        points: Array,
        covariances: Mapping[str, Array],
        centroids: Mapping[str, Array],
        pose: str | None,
    ) -> Array:
        """Mean squares (n,) in mm^2, with the part of the bones that carry each point."""
        factor, floor = CALIBRATIONS[known.kind]
        squares = known.hidden + known.fit_variance(pose) + factor**2 * known.open_variance(frame.bones)
        carried = np.zeros(len(points))
        for share, bone in zip(known.carried.T, self.bones, strict=True):
            if bone in covariances:
                near = np.flatnonzero(share > LITTLE)
                moved = variance_at(covariances[bone], points[near] - centroids[bone])
                carried[near] += share[near] * moved
        # Along the normal of a surface, one of three directions.
        return np.asarray(squares + carried / 3 + (floor * self.voxel) ** 2)

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the artifact of kind "deviations"."""
        data = {
            "bones": list(self.bones),
            "joints": {str(i): joint.to_group() for i, joint in enumerate(self.joints)},
            "scanned": {pose: dict(bones) for pose, bones in self.scanned.items()},
            "bodies": {name: body.to_group() for name, body in self.bodies.items()},
            "voxel": self.voxel,
        }
        squares = ("scale", "fits", "hidden")
        units = {f"bodies/{name}/{field}": "mm^2" for name in self.bodies for field in squares}
        artifacts.write(path, data, kind=KIND, units=units | {"voxel": "mm"}, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> HandDeviations:
        """Read what `save` wrote; raises `InputError` for another file."""
        data = artifacts.read(path, KIND, finite=True)
        joints = data.get("joints", {})
        return HandDeviations(
            tuple(str(bone) for bone in data["bones"]),
            tuple(JointDeviation.from_group(joints[str(i)]) for i in range(len(joints))),
            data.get("scanned", {}),
            {name: BodyDeviation.from_group(body) for name, body in data.get("bodies", {}).items()},
            float(data["voxel"]),
        )
