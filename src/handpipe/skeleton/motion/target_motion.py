"""Angles of frames from targets at times: inverse kinematics at keys, splines between them.

Each key is solved by itself, from the pose that it names. A target that two successive keys share is met by
the frames between them, too: each starts from the spline and keeps near to it.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.drivers.bone_lines import bone_tips, joint_places
from handpipe.skeleton.motion.interpolation import angles_between, spline
from handpipe.skeleton.motion.motion import Motion
from handpipe.skeleton.motion.target_file import BonePoint, Goal, TargetKey, read_targets
from handpipe.skeleton.posing.inverse_kinematics import Limits, Reach, ReachOptions, solve
from handpipe.skeleton.posing.targets import Apart, Meeting, Position, Target
from handpipe.skeleton.posing.validity import PoseValidity
from handpipe.skeleton.rig.rig import Rig

LOG = logging.getLogger(__name__)
MET = 1.0  # mm; a target that is as near is met
OPTIONS = ReachOptions(rest_weight=2.0, tolerance=MET)  # mm that a rad from the key's own pose counts as
NEAR = replace(OPTIONS, restarts=False)
PARTINGS, LASTING = 6, 2  # rounds of pushing colliding bones apart; rounds for which a push lasts
PUSH = 3.0  # a millimetre of penetration beside one of a target
FACING, ARM = 0.15, 10.0  # weight of pads that face each other; mm along their normals where they do
BOX = np.radians(8.0)  # by which a frame between keys may leave the spline: neighbours stay neighbours
PAD = 0.8  # of the way from a bone's joint to its end

Spot = tuple[str, str | tuple[float, float, float]]  # bone, and the place on it


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
    found = [solver.key(key) for key in file.keys]
    said = [f"{name}: {reach}" for name, reach in zip(times.names, found, strict=True) if not reach.reached]
    at = times.frames
    frames = angles_between(times.times, [reach.angles for reach in found], rig.angle_names, at)
    distances: dict[int, float] = {}
    for i, (key, time) in enumerate(zip(file.keys, times.times, strict=True)):
        if (key.touch or key.reach) and abs(time - round(time)) < 1e-6:
            distances[round(time)] = max(found[i].distances)
    for first, pair in enumerate(zip(file.keys, file.keys[1:], strict=False)):
        touches, goals = _shared(*pair)
        if not (touches or goals):
            continue
        paths = [_Path.through(file.keys, times.times, goal) for goal in goals]
        between = (at > times.times[first] + 1e-6) & (at < times.times[first + 1] - 1e-6)
        for frame in np.flatnonzero(between):
            asked = [solver.meeting(*touch) for touch in touches]
            asked += [solver.position(p.spot, p.at(at[frame])) for p in paths]
            reach = solver.near(frames[frame], asked, solver.facing(touches), BOX)
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


class TargetSolver:
    """Inverse kinematics of keys and frames, with bones kept out of one another."""

    def __init__(self, rig: Rig, flesh: float, validity: PoseValidity) -> None:
        self.rig, self.validity = rig, validity
        self.joints, self.tips = joint_places(rig), bone_tips(rig)
        ends = self._ends()
        self.normals = {b: n for b, end in ends.items() if (n := _palmar(rig, b, end)) is not None}
        self.pads = {b: _pad(rig, b, ends[b], n, flesh) for b, n in self.normals.items()}

    def _ends(self) -> dict[str, Array]:
        """The far end of every bone that has a joint: its tip, or the mean of the joints that it carries."""
        carried = {
            bone: np.mean([self.joints[j.child] for j in self.rig.joints if j.parent == bone], axis=0)
            for bone in set(self.rig.parents.values()) & set(self.joints)
        }
        return carried | self.tips

    def key(self, key: TargetKey) -> Reach:
        """A key's own pose brought to its targets."""
        rest = dict.fromkeys(self.rig.angle_names, 0.0)
        rest |= {name: float(np.radians(value)) for name, value in key.angles.items()}
        touches = [(_spot(a), _spot(b)) for a, b in key.touch]
        asked: list[Target] = [self.meeting(*touch) for touch in touches]
        asked += [self.position(_spot(goal), np.array(goal.to)) for goal in key.reach]
        found = self.near(rest, asked, self.facing(touches))
        if found.reached:
            return found
        other = solve(self.rig, asked, start=rest, rest=rest, options=OPTIONS)
        other = self.near(other.angles, asked, self.facing(touches))
        return min(found, other, key=lambda r: max(r.distances))

    def near(
        self,
        angles: Mapping[str, float],
        targets: Sequence[Target],
        further: Sequence[Target] = (),
        box: float = np.inf,
    ) -> Reach:
        """Angles near given ones, by `box` in rad, that meet targets; bones that collide are pushed apart."""
        limits = {
            name: (max(low, angles[name] - box), min(high, angles[name] + box))
            for name, (low, high) in self.rig.limits.items()
        }
        further = list(further)
        reach = self._solved(targets, further, angles, angles, limits)
        rounds: list[list[Target]] = []
        for _ in range(PARTINGS):
            contacts = self.validity.contacts(reach.angles)
            if not contacts:
                break
            rounds.append(
                [Apart(c.bone, c.point, c.other, c.closest, c.normal, c.allowed, PUSH) for c in contacts]
            )
            pushes = [push for each in rounds[-LASTING:] for push in each]
            reach = self._solved(targets, [*further, *pushes], reach.angles, angles, limits)
        return reach

    def _solved(
        self,
        targets: Sequence[Target],
        further: Sequence[Target],
        start: Mapping[str, float],
        rest: Mapping[str, float],
        limits: Limits,
    ) -> Reach:
        """Angles by all targets, with the distances of the first ones alone."""
        found = solve(self.rig, [*targets, *further], start=start, rest=rest, limits=limits, options=NEAR)
        left = found.distances[: len(targets)]
        return Reach(found.angles, left, found.at_limits if max(left, default=0.0) > MET else {}, MET)

    def facing(self, touches: Sequence[tuple[Spot, Spot]]) -> list[Target]:
        """That pads which touch face each other: a point before each is to be behind the other."""
        found: list[Target] = []
        for a, b in touches:
            if a[1] == b[1] == "pad" and a[0] in self.normals and b[0] in self.normals:
                for first, second in ((a, b), (b, a)):
                    before = self._point(first) + ARM * self.normals[first[0]]
                    behind = self._point(second) - ARM * self.normals[second[0]]
                    found.append(Meeting(first[0], before, second[0], behind, FACING))
        return found

    def meeting(self, first: Spot, second: Spot) -> Target:
        """That two spots meet."""
        return Meeting(first[0], self._point(first), second[0], self._point(second))

    def position(self, spot: Spot, place: Array) -> Target:
        """That a spot is at a place (3,) in mm."""
        return Position(spot[0], self._point(spot), place)

    def _point(self, spot: Spot) -> Array:
        bone, at = spot
        if at == "pad" and bone in self.pads:
            return self.pads[bone]
        if isinstance(at, str):
            return self.tips.get(bone, self.rig.surfaces[bone].vertices.mean(axis=0))
        return np.array(at, float)


def _spot(place: BonePoint | Goal) -> Spot:
    return place.bone, place.at


def _shared(first: TargetKey, second: TargetKey) -> tuple[list[tuple[Spot, Spot]], list[Spot]]:
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


def _pad(rig: Rig, bone: str, end: Array, normal: Array, flesh: float) -> Array:
    """Neutral point (3,) in mm on the skin of a bone's palmar side, near its end."""
    joint = next(j for j in rig.joints if j.child == bone)
    inside: Array = joint.fit.centre + PAD * (end - joint.fit.centre)
    vertices = rig.surfaces[bone].vertices
    close = np.linalg.norm(np.cross(vertices - inside, normal), axis=1) < 3.0  # mm from the line outwards
    surface = float(((vertices - inside) @ normal)[close].max(initial=0.0))
    return inside + (surface + flesh) * normal
