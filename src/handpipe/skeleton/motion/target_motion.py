"""Angles of frames from targets at times: inverse kinematics at keys, splines between them.

Each key is solved by itself, from the pose that it names. A target that two successive keys share is met by
the frames between them, too. Each starts from the spline and keeps near to the poses that the keys name, as
the keys do: the motion passes into them without a jump.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.drivers.bone_lines import bone_tips, joint_places
from handpipe.skeleton.motion.interpolation import angles_between, spline
from handpipe.skeleton.motion.motion import Motion
from handpipe.skeleton.motion.target_file import BonePoint, Goal, TargetKey, read_targets
from handpipe.skeleton.posing.inverse_kinematics import Limits, Reach, ReachOptions, solve
from handpipe.skeleton.posing.pose_space import ancestry
from handpipe.skeleton.posing.targets import Apart, Meeting, Position, Target
from handpipe.skeleton.posing.validity import PoseValidity
from handpipe.skeleton.rig.rig import Rig

LOG = logging.getLogger(__name__)
MET = 1.0  # mm; a target that is as near is met
OPTIONS = ReachOptions(rest_weight=2.0, tolerance=MET)  # mm that a rad from the key's own pose counts as
NEAR = replace(OPTIONS, restarts=False)
PARTINGS, LASTING = 6, 2  # rounds of pushing colliding bones apart; rounds for which a push lasts
PUSH = 3.0  # a millimetre of penetration beside one of a target
FACING, ARM = 0.15, 10.0  # weight of skin that faces each other; mm along its normals where it does
BOX = np.radians(8.0)  # by which a frame between keys may leave the spline: neighbours stay neighbours
PAD, BACK = 0.8, 0.5  # of the way from a bone's joint to its end
THIN = 0.4  # of the flesh of a pad that lies on the back of a bone

Spot = tuple[str, str | tuple[float, float, float]]  # bone, and the place on it
Touch = tuple[Spot, Spot]


def read_target_motion(path: str | Path, rig: Rig) -> Motion:
    """Angles of the frames of a file of targets, within limits.

    Parameters
    ----------
    path : str or Path
        YAML file of targets.
    rig : Rig
        Rig that is posed.

    Returns
    -------
    Motion
        Frames; `target_distance` in mm of those with targets. Keys whose targets are not reached are named.

    Raises
    ------
    InputError
        If the file is wrong, or names an unknown bone.
    """
    file, times = read_targets(path, rig.limits, rig.bones)
    solver = TargetSolver(rig, file.flesh, PoseValidity(rig))
    own = [solver.own_pose(key) for key in file.keys]
    found = [solver.key(key, rest) for key, rest in zip(file.keys, own, strict=True)]
    said = [f"{name}: {reach}" for name, reach in zip(times.names, found, strict=True) if not reach.reached]
    at = times.frames
    frames = angles_between(times.times, [reach.angles for reach in found], rig.angle_names, at)
    rests = angles_between(times.times, own, rig.angle_names, at)
    distances: dict[int, float] = {}
    for i, (key, time) in enumerate(zip(file.keys, times.times, strict=True)):
        if (key.touch or key.reach) and abs(time - round(time)) < 1e-6:
            distances[round(time)] = max(found[i].distances)
    for first, pair in enumerate(zip(file.keys, file.keys[1:], strict=False)):
        touches, goals = _shared(*pair)
        if not (touches or goals):
            continue
        paths = [_Path.through(file.keys, times.times, goal) for goal in goals]
        still = set(pair[0].still) & set(pair[1].still)
        between = (at > times.times[first] + 1e-6) & (at < times.times[first + 1] - 1e-6)
        for frame in np.flatnonzero(between):
            places = {path.spot: path.at(at[frame]) for path in paths}
            limits = solver.limits(frames[frame], still, BOX)
            reach = solver.near(frames[frame], rests[frame], solver.asked(touches, places), limits)
            frames[frame], distances[int(frame)] = reach.angles, max(reach.distances)
            if not reach.reached:
                said.append(f"{times.frame_names[frame]}: {max(reach.distances):.1f} mm are left")
    for sentence in said:
        LOG.warning("%s: %s", path, sentence)
    names = times.frame_names
    figures = {names[i]: {"target_distance": d} for i, d in distances.items()}
    return Motion(dict(zip(names, frames, strict=True)), figures, said)


@dataclass(frozen=True)
class _Path:
    """Places (k, 3) in mm of one point at times (k,)."""

    spot: Spot
    times: Array
    places: Array

    @staticmethod
    def through(keys: Sequence[TargetKey], times: Array, spot: Spot) -> _Path:
        given = [(t, g.to) for key, t in zip(keys, times, strict=True) for g in key.reach if _spot(g) == spot]
        return _Path(spot, np.array([t for t, _ in given]), np.array([place for _, place in given]))

    def at(self, time: float) -> Array:
        place: Array = spline(self.times, self.places, np.array([time]))[0]
        return place


@dataclass(frozen=True)
class Asked:
    """What angles are to do.

    Parameters
    ----------
    targets : sequence of Target
        What is to be met.
    facing : sequence of Target
        What counts less: that skin which touches faces each other.
    """

    targets: Sequence[Target] = ()
    facing: Sequence[Target] = ()


class TargetSolver:
    """Inverse kinematics of keys and frames, with bones kept out of one another."""

    def __init__(self, rig: Rig, flesh: float, validity: PoseValidity) -> None:
        self.rig, self.validity = rig, validity
        self.joints, self.tips = joint_places(rig), bone_tips(rig)
        ends = self._ends()
        self.on_skin: dict[Spot, tuple[Array, Array]] = {}  # points (3,) and outward normals (3,), neutral
        for bone, end in ends.items():
            if (normal := _palmar(rig, bone, end)) is not None:
                pad = _skin(rig, bone, end, PAD, normal, flesh)
                back = _skin(rig, bone, end, BACK, -normal, THIN * flesh)
                self.on_skin |= {(bone, "pad"): (pad, normal), (bone, "back"): (back, -normal)}

    def _ends(self) -> dict[str, Array]:
        """The far end of every bone that has a joint: its tip, or the mean of the joints that it carries."""
        carried = {
            bone: np.mean([self.joints[j.child] for j in self.rig.joints if j.parent == bone], axis=0)
            for bone in set(self.rig.parents.values()) & set(self.joints)
        }
        return carried | self.tips

    def own_pose(self, key: TargetKey) -> dict[str, float]:
        """The angles in rad that a key names; 0 for all others."""
        return dict.fromkeys(self.rig.angle_names, 0.0) | key.radians

    def key(self, key: TargetKey, rest: Mapping[str, float]) -> Reach:
        """A key's own pose, `rest`, brought to its targets."""
        places = {_spot(goal): np.array(goal.to) for goal in key.reach}
        asked = self.asked([(_spot(a), _spot(b)) for a, b in key.touch], places)
        limits = self.limits(rest, key.still)
        found = self.near(rest, rest, asked, limits)
        if found.reached:
            return found
        other = solve(self.rig, asked.targets, start=rest, rest=rest, limits=limits, options=OPTIONS)
        return min(found, self.near(other.angles, rest, asked, limits), key=lambda r: max(r.distances))

    def asked(self, touches: Sequence[Touch], places: Mapping[Spot, Array]) -> Asked:
        """Spots that are to meet, and spots that are to be at places (3,) in mm."""
        targets: list[Target] = [Meeting(a[0], self._point(a), b[0], self._point(b)) for a, b in touches]
        targets += [Position(spot[0], self._point(spot), place) for spot, place in places.items()]
        facing = [target for touch in touches for target in self._facing(touch)]
        return Asked(targets, facing)

    def limits(self, angles: Mapping[str, float], still: Iterable[str] = (), box: float = np.inf) -> Limits:
        """The rig's limits in rad within a box about angles; joints of still bones keep these angles."""
        fixed = self._angles_that_move(still)
        boxes = {name: 0.0 if name in fixed else box for name in self.rig.limits}
        return {
            name: (max(low, angles[name] - boxes[name]), min(high, angles[name] + boxes[name]))
            for name, (low, high) in self.rig.limits.items()
        }

    def _angles_that_move(self, bones: Iterable[str]) -> set[str]:
        """Names of the angles of all joints between bones and the root."""
        moved = {ancestor for bone in bones for ancestor in ancestry(bone, self.rig.parents)}
        return {angle for joint in self.rig.joints if joint.child in moved for angle in joint.angles}

    def near(
        self, start: Mapping[str, float], rest: Mapping[str, float], asked: Asked, limits: Limits
    ) -> Reach:
        """Angles near `rest`, from a start, that do what is asked; bones that collide are pushed apart."""
        reach = self._solved(asked, [], start, rest, limits)
        rounds: list[list[Target]] = []
        for _ in range(PARTINGS):
            contacts = self.validity.contacts(reach.angles)
            if not contacts:
                break
            rounds.append(
                [Apart(c.bone, c.point, c.other, c.closest, c.normal, c.allowed, PUSH) for c in contacts]
            )
            pushes = [push for each in rounds[-LASTING:] for push in each]
            reach = self._solved(asked, pushes, reach.angles, rest, limits)
        return reach

    def _solved(
        self,
        asked: Asked,
        pushes: Sequence[Target],
        start: Mapping[str, float],
        rest: Mapping[str, float],
        limits: Limits,
    ) -> Reach:
        """Angles by all that is asked, with the distances of the targets alone."""
        every = [*asked.targets, *asked.facing, *pushes]
        found = solve(self.rig, every, start=start, rest=rest, limits=limits, options=NEAR)
        left = found.distances[: len(asked.targets)]
        return Reach(found.angles, left, found.at_limits if max(left, default=0.0) > MET else {}, MET)

    def _facing(self, touch: Touch) -> list[Target]:
        """That skin which touches faces each other: a point before each place is to be behind the other."""
        if not all(spot in self.on_skin for spot in touch):
            return []
        (a, at_a, from_a), (b, at_b, from_b) = ((spot[0], *self.on_skin[spot]) for spot in touch)
        return [
            Meeting(a, at_a + ARM * from_a, b, at_b - ARM * from_b, FACING),
            Meeting(b, at_b + ARM * from_b, a, at_a - ARM * from_a, FACING),
        ]

    def _point(self, spot: Spot) -> Array:
        bone, at = spot
        if spot in self.on_skin:
            return self.on_skin[spot][0]
        if isinstance(at, str):
            return self.tips.get(bone, self.rig.surfaces[bone].vertices.mean(axis=0))
        return np.array(at, float)


def _spot(place: BonePoint | Goal) -> Spot:
    return place.bone, place.at


def _shared(first: TargetKey, second: TargetKey) -> tuple[list[Touch], list[Spot]]:
    """Touches, and points with goals, that both keys have."""
    pairs = [[(_spot(a), _spot(b)) for a, b in key.touch] for key in (first, second)]
    goals = [[_spot(goal) for goal in key.reach] for key in (first, second)]
    return [p for p in pairs[0] if p in pairs[1]], [g for g in goals[0] if g in goals[1]]


def _palmar(rig: Rig, bone: str, end: Array) -> Array | None:
    """Unit normal (3,) in neutral of a bone's palmar side: where its end goes as its joint bends."""
    joint = next(j for j in rig.joints if j.child == bone)
    if not joint.angles:
        return None
    normal = np.cross(joint.fit.axes.directions[0], end - joint.fit.centre)
    size = float(np.linalg.norm(normal))
    return normal / size if size > 0 else None


def _skin(rig: Rig, bone: str, end: Array, share: float, normal: Array, flesh: float) -> Array:
    """Neutral point (3,) in mm on the skin, a share of the way to a bone's end, out along a unit normal."""
    joint = next(j for j in rig.joints if j.child == bone)
    inside: Array = joint.fit.centre + share * (end - joint.fit.centre)
    vertices = rig.surfaces[bone].vertices
    close = np.linalg.norm(np.cross(vertices - inside, normal), axis=1) < 3.0  # mm from the line outwards
    surface = float(((vertices - inside) @ normal)[close].max(initial=0.0))
    return inside + (surface + flesh) * normal
