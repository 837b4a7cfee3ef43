"""Whether a pose is inside the examples, and whether its bones run into one another (Wang 2021 chapter 7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, Metrics, RigidTransform
from handpipe.mesh.surfaces import Distance, about
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.limits import Limits, seen_ranges
from handpipe.skeleton.rig.rig import Rig

Pair = tuple[str, str]
SLACK = 1e-9  # rad
TOUCH = 0.3  # mm that bones may lie deeper in one another than in neutral: the error of their surfaces


@dataclass(frozen=True)
class PoseCheck:
    """How far a pose is from the seen ones, and which bones collide in it.

    Parameters
    ----------
    beyond : dict of str to float
        Angle in rad by which a joint angle leaves its seen range, positive above and negative below.
    nearest : str
        Seen pose of least root mean square difference of angles.
    distance : float
        That difference in rad.
    spacing : float
        Largest such difference in rad from one seen pose to its nearest.
    collisions : dict of (str, str) to float
        Depth of penetration in mm beyond that in neutral, by pair of bones.
    """

    beyond: dict[str, float]
    nearest: str
    distance: float
    spacing: float
    collisions: dict[Pair, float]

    @property
    def inside(self) -> bool:
        """Whether every joint is in its seen range and the pose no farther from a seen one than those are."""
        return not self.beyond and self.distance <= self.spacing

    @property
    def valid(self) -> bool:
        """Whether the pose is inside what was seen and no bones collide."""
        return self.inside and not self.collisions

    def __str__(self) -> str:
        """One line: angles beyond the seen range, distance to the nearest seen pose, and collisions."""
        parts = [f"{n} {np.degrees(a):+.1f} deg beyond what was seen" for n, a in self.beyond.items()]
        if self.distance > self.spacing:
            parts.append(f"{np.degrees(self.distance):.1f} deg from the nearest seen pose, {self.nearest}")
        parts += [f"{a} {d:.1f} mm in {b}" for (a, b), d in self.collisions.items()]
        return "; ".join(parts) or f"inside what was seen, nearest to {self.nearest}"


@dataclass(frozen=True)
class BonePenetration:
    """A neutral point (3,) of a bone inside another one.

    Parameters
    ----------
    bone : str
        Bone of the point.
    point : array (3,)
        Neutral point in mm.
    other : str
        Bone that it is inside.
    closest : array (3,)
        Neutral point of the other bone's surface that is closest, mm.
    normal : array (3,)
        Unit normal there, outwards, in neutral.
    allowed : float
        Depth in mm that does not count, since the bones have it in neutral.
    """

    bone: str
    point: Array
    other: str
    closest: Array
    normal: Array
    allowed: float


class PoseValidity:
    """A rig's seen poses and bone surfaces, prepared for many checks of poses.

    Parameters
    ----------
    rig : Rig
        Rig with scanned poses.
    poses : sequence of str, optional
        Names of the rig's poses that count as seen, by default all. Neutral always counts.
    """

    def __init__(self, rig: Rig, poses: Sequence[str] | None = None) -> None:
        """Measure the seen poses, and how deep bones lie in one another in neutral."""
        chosen = rig.poses if poses is None else {p: rig.poses[p] for p in poses}
        self.rig = rig
        self.poses: dict[str, Angles] = {p: f.known for p, f in chosen.items() if f.known or not f.angles}
        neutral = [a for a in self.poses.values() if all(abs(a.get(n, 1.0)) < 1e-6 for n in rig.angle_names)]
        if not neutral:
            self.poses = {"neutral": dict.fromkeys(rig.angle_names, 0.0)} | self.poses
        self.ranges: Limits = dict.fromkeys(rig.angle_names, (0.0, 0.0)) | seen_ranges(self.poses)
        # NaN: an angle that the pose does not determine is no part of the distance to it.
        self._seen = np.array([[a.get(n, np.nan) for n in rig.angle_names] for a in self.poses.values()])
        self._distances = {b: Distance(s) for b, s in rig.surfaces.items()}
        self._spheres = {b: _sphere(s.vertices) for b, s in rig.surfaces.items()}
        zero = dict.fromkeys(rig.angle_names, 0.0)
        self._neutral = depths(rig, rig.bone_transforms(zero), self._distances, self._spheres)

    def check(self, angles: Mapping[str, float]) -> PoseCheck:
        """How far a pose is from the seen ones, and which bones collide in it.

        Parameters
        ----------
        angles : mapping of str to float
            All angles of the rig in rad.

        Returns
        -------
        PoseCheck
            What is known of the pose.
        """
        beyond = {}
        for name, (lower, upper) in self.ranges.items():
            excess = max(angles[name] - upper, 0.0) + min(angles[name] - lower, 0.0)
            if abs(excess) > SLACK:
                beyond[name] = excess
        values = np.array([angles[n] for n in self.rig.angle_names])
        apart = np.sqrt(np.nanmean((self._seen - values) ** 2, axis=1))
        nearest = int(np.argmin(apart))
        found = depths(self.rig, self.rig.bone_transforms(angles), self._distances, self._spheres)
        deeper = {pair: d - self._neutral.get(pair, 0.0) for pair, d in found.items()}
        collisions = {pair: d for pair, d in deeper.items() if d > TOUCH}
        return PoseCheck(
            beyond, list(self.poses)[nearest], float(apart[nearest]), self._spacing(), collisions
        )

    def contacts(self, angles: Mapping[str, float]) -> list[BonePenetration]:
        """Where bones lie deepest in one another, beyond what they do in neutral.

        Parameters
        ----------
        angles : mapping of str to float
            All angles of the rig in rad.

        Returns
        -------
        list of BonePenetration
            The deepest vertex of each bone of each colliding pair.
        """
        bones = self.rig.bone_transforms(angles)
        found = []
        for pair in self.check(angles).collisions:
            for bone, other in (pair, pair[::-1]):
                across = bones[other].inverse() @ bones[bone]
                vertices = self.rig.surfaces[bone].vertices
                signed, _, closest, normals = self._distances[other].signed(across(vertices))
                i, allowed = int(np.argmin(signed)), self._neutral.get(pair, 0.0)
                if -signed[i] > allowed:
                    found.append(BonePenetration(bone, vertices[i], other, closest[i], normals[i], allowed))
        return found

    def _spacing(self) -> float:
        between = np.sqrt(np.nanmean((self._seen[:, None] - self._seen[None]) ** 2, axis=2))
        np.fill_diagonal(between, np.inf)
        return float(between.min(axis=1).max()) if len(between) > 1 else 0.0


def depths(
    rig: Rig,
    transforms: Mapping[str, RigidTransform],
    distances: Mapping[str, Distance],
    spheres: Mapping[str, tuple[Array, float]],
) -> dict[Pair, float]:
    """How deep in mm bones lie in one another, by pair; pairs that are clear are left out.

    The depth is the largest signed distance of either bone's vertices inside the other. Bones that move as
    one do not count.
    """
    body = {rig.root: rig.root}
    for joint in rig.joints:
        body[joint.child] = joint.child if joint.angles else body[joint.parent]
    found: dict[Pair, float] = {}
    bones = list(rig.bones)
    for i, a in enumerate(bones):
        for b in bones[i + 1 :]:
            (ca, ra), (cb, rb) = spheres[a], spheres[b]
            if np.linalg.norm(transforms[a](ca) - transforms[b](cb)) > ra + rb:
                continue
            if body[a] == body[b]:
                continue
            across = transforms[b].inverse() @ transforms[a]
            depth = max(
                _depth(distances[b], across(rig.surfaces[a].vertices)),
                _depth(distances[a], across.inverse()(rig.surfaces[b].vertices)),
            )
            if depth > 0:
                found[a, b] = depth
    return found


def _depth(surface: Distance, points: Array) -> float:
    """Largest depth in mm of points (n, 3) inside a surface; only those in its boxes are asked."""
    near = about(points, surface.surface, 0.0)
    return float(max(-surface.signed(points[near])[0].min(), 0.0)) if len(near) else 0.0


def _sphere(points: Array) -> tuple[Array, float]:
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def validity_table(
    validity: PoseValidity, frames: Mapping[str, Mapping[str, float]]
) -> tuple[list[dict[str, str | float]], Metrics]:
    """A table of the validity of frames, and its figures.

    Parameters
    ----------
    validity : PoseValidity
        Seen poses of the rig.
    frames : mapping of str to mapping of str to float
        Angles in rad by frame and angle name.

    Returns
    -------
    rows : list of dict
        One row per frame: `frame`, `beyond` in deg with the `angle` that is farthest beyond its seen range,
        `distance` in deg from the `nearest` seen pose, `depth` in mm with the `bones` that penetrate deepest.
    metrics : Metrics
        Numbers of unseen and of colliding frames, largest and mean `distance`, the largest `beyond` and the
        largest `depth`.
    """
    rows: list[dict[str, str | float]] = []
    found = [(name, validity.check(angles)) for name, angles in frames.items()]
    for name, v in found:
        angle, beyond = max(v.beyond.items(), key=lambda item: abs(item[1]), default=("", 0.0))
        pair, depth = max(v.collisions.items(), key=lambda item: item[1], default=(("", ""), 0.0))
        rows.append(
            {
                "frame": name,
                "beyond": float(np.degrees(beyond)),
                "angle": angle,
                "distance": float(np.degrees(v.distance)),
                "nearest": v.nearest,
                "depth": depth,
                "bones": " ".join(pair).strip(),
            }
        )
    metrics: Metrics = {
        "frames_unseen": (float(sum(not v.inside for _, v in found)), "frames"),
        "frames_colliding": (float(sum(bool(v.collisions) for _, v in found)), "frames"),
        "distance_max": (max((float(r["distance"]) for r in rows), default=0.0), "deg"),
        "distance_mean": (float(np.mean([r["distance"] for r in rows])) if rows else 0.0, "deg"),
        "beyond_max": (max((abs(float(r["beyond"])) for r in rows), default=0.0), "deg"),
        "bone_depth_max": (max((float(r["depth"]) for r in rows), default=0.0), "mm"),
    }
    return rows, metrics
