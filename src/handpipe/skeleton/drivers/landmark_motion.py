"""Joint angles from 21 hand landmarks a frame: the palm gives frame and scale, inverse kinematics the angles.

People's fingers differ in length from the rig's, and landmarks from joint centres. Therefore the directions
from landmark to landmark are transferred to bones of the rig's own length; places of landmarks count little.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError, RigidTransform
from handpipe.skeleton.drivers.bone_lines import bone_tips, joint_places
from handpipe.skeleton.drivers.landmarks import FINGERS, LANDMARKS, Hand, HandLandmarks, read_landmarks
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.limits import long_axis
from handpipe.skeleton.posing.inverse_kinematics import Reach, ReachOptions, solve
from handpipe.skeleton.posing.targets import LEVER, Direction, Position, Target
from handpipe.skeleton.rig.rig import Rig

log = logging.getLogger(__name__)

BONES = {
    "THUMB": ("metacarpal1", "proximal1", "distal1"),
    **{
        f: tuple(f"{part}{d}" for part in ("proximal", "middle", "distal"))
        for d, f in enumerate(FINGERS, start=2)
    },
}
ENDS = {"THUMB": ("CMC", "MCP", "IP", "TIP"), **dict.fromkeys(FINGERS, ("MCP", "PIP", "DIP", "TIP"))}
KNUCKLES = tuple(f"{finger}_MCP" for finger in FINGERS)
ARM = 1.5  # widths of the row of knuckles from them to the point that tells the palm's direction
LEAN = 0.3  # weight of a landmark's place, where the direction of its bone has one
FAINT = 0.3  # weight in the palm of landmarks that do not move with the root bone
PALM_ERROR = 0.35  # distance of the palm's landmarks from the rig's, relative to their spread
REST_WEIGHT, TOLERANCE = 0.3, 5.0  # 1 and mm: of the angles at rest, and of landmarks
ROUNDS, SETTLED = 20, 1e-4  # 1 and rad: the palm is placed again until angles stay
NARROW = 0.05  # second extent of the palm's landmarks over the first, below which they place no hand
LANDMARK_NUMBERS = {  # by which the page of a hand fits landmarks, too
    "arm": ARM,
    "knuckles": KNUCKLES,
    "lean": LEAN,
    "lever": LEVER,
    "narrow": NARROW,
    "palm_error": PALM_ERROR,
    "rest": REST_WEIGHT,
}


@dataclass(frozen=True)
class LandmarkMap:
    """Where landmarks are on a rig.

    Parameters
    ----------
    places : dict of str to (str, array (3,))
        Bone and neutral point in mm of each landmark.
    segments : dict of str to (str, str)
        The two landmarks of each bone.
    """

    places: dict[str, tuple[str, Array]]
    segments: dict[str, tuple[str, str]]

    @staticmethod
    def of_rig(rig: Rig) -> LandmarkMap:
        """The bones that carry the landmarks of a rig.

        A landmark lies on the bone that carries its joint.

        Parameters
        ----------
        rig : Rig
            Rig with bones that are named metacarpal1, proximal1..5, middle2..5, distal1..5; some may be
            absent.

        Returns
        -------
        LandmarkMap
            Bones by landmark.

        Raises
        ------
        InputError
            If no bone has the name of a finger's.
        """
        joints, tips, parents = joint_places(rig), bone_tips(rig), rig.parents
        places: dict[str, tuple[str, Array]] = {}
        segments: dict[str, tuple[str, str]] = {}
        for finger, bones in BONES.items():
            names = [f"{finger}_{end}" for end in ENDS[finger]]
            for bone, first, second in zip(bones, names[:-1], names[1:], strict=True):
                if bone in joints:
                    places[first] = (parents[bone], joints[bone])
                    segments[bone] = (first, second)
                if bone in tips:
                    places[second] = (bone, tips[bone])
        segments = {b: pair for b, pair in segments.items() if pair[0] in places and pair[1] in places}
        if not segments:
            remedy = "Name them metacarpal1, proximal1 to 5, middle2 to 5 and distal1 to 5"
            raise InputError("landmarks", "bones", "the rig has no bones with the names of fingers", remedy)
        return LandmarkMap(places, segments)

    def with_wrist(self, rig: Rig) -> LandmarkMap:
        """With a point of the palm's direction, `ARM` knuckle widths before the knuckles.

        As it is where the bone of the middle knuckle has no long axis, or a knuckle is missing.
        """
        if not {*KNUCKLES} <= self.places.keys():
            return self
        knuckles = np.array([self.places[name][1] for name in KNUCKLES])
        bone, knuckle = self.places["MIDDLE_FINGER_MCP"]
        along = long_axis(rig.surfaces[bone])
        if along is None:
            return self
        along = along * np.sign(along @ (knuckle - rig.surfaces[bone].vertices.mean(axis=0)))
        return LandmarkMap(self.places | {"WRIST": (bone, wrist(knuckles, along))}, self.segments)

    def palm(self, rig: Rig) -> dict[str, float]:
        """The landmarks that place a palm.

        Parameters
        ----------
        rig : Rig
            The rig of the map.

        Returns
        -------
        dict of str to float
            Weights by landmark, smaller for those that do not move with the root bone.
        """
        palm = [n for n in ("WRIST", "THUMB_CMC", *KNUCKLES) if n in self.places]
        bones = {n: self.places[n][0] for n in palm}
        weights = {n: 1.0 if bones[n] == rig.root or _rigid(rig, bones[n]) else FAINT for n in palm}
        if {"WRIST", "THUMB_CMC"} <= weights.keys():  # places of a thumb's joint differ between trackers
            weights["THUMB_CMC"] = FAINT
        return weights

    def points(self, bones: Mapping[str, RigidTransform]) -> Array:
        """The 21 landmarks with bones that are moved from neutral.

        Parameters
        ----------
        bones : mapping of str to RigidTransform
            Transforms from neutral.

        Returns
        -------
        array (21, 3)
            Points in mm in the order of `LANDMARKS`, NaN of landmarks that the rig has not.
        """
        found = np.full((len(LANDMARKS), 3), np.nan)
        for row, name in enumerate(LANDMARKS):
            if name in self.places:
                bone, point = self.places[name]
                found[row] = bones[bone](point)
        return found


def landmark_map(rig: Rig) -> LandmarkMap:
    """Where the 21 landmarks are on a rig; none on one that is no hand.

    Parameters
    ----------
    rig : Rig
        Rig with bones of any names.

    Returns
    -------
    LandmarkMap
        Places of the landmarks that it has.
    """
    try:
        return LandmarkMap.of_rig(rig).with_wrist(rig)
    except InputError:
        return LandmarkMap({}, {})


def wrist(knuckles: Array, along: Array) -> Array:
    """The point (3,) `ARM` knuckle widths before the knuckles (4, 3), against the palm's direction (3,)."""
    width = float(np.linalg.norm(knuckles[0] - knuckles[-1]))
    point: Array = knuckles.mean(axis=0) - ARM * width * along
    return point


def directed(points: Mapping[str, Array]) -> dict[str, Array]:
    """Landmarks (3,) by name whose wrist tells the palm's direction alone.

    How far the wrist is from the knuckles differs between trackers.
    """
    if not {"WRIST", *KNUCKLES} <= points.keys():
        return dict(points)
    knuckles = np.array([points[name] for name in KNUCKLES])
    along = knuckles.mean(axis=0) - points["WRIST"]
    length = float(np.linalg.norm(along))
    return dict(points) if length == 0 else {**points, "WRIST": wrist(knuckles, along / length)}


@dataclass(frozen=True)
class LandmarkFit:
    """Angles in rad that landmarks gave, and root mean square residuals.

    `distance` in mm is that of the landmarks from the rig's points, which people's proportions decide;
    `turn` in rad that of the bones' directions.
    """

    angles: Angles
    distance: float
    turn: float

    @staticmethod
    def measure(found: Reach, targets: Sequence[Target]) -> LandmarkFit:
        """The residuals of what inverse kinematics found."""
        pairs = [*zip(found.distances, targets, strict=True)]
        places = [d / LEAN for d, t in pairs if isinstance(t, Position)]
        turns = [d / t.lever for d, t in pairs if isinstance(t, Direction)]
        return LandmarkFit(found.angles, _mean_square(places), _mean_square(turns))


def _mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else 0.0


def read_landmark_angles(path: str | Path, rig: Rig, hand: Hand = "right") -> dict[str, Angles]:
    """Joint angles of a file of MediaPipe landmarks, within their limits.

    Parameters
    ----------
    path : str or Path
        Landmarks as .json or .csv.
    rig : Rig
        Rig that the landmarks move.
    hand : str
        "right" or "left": the hand that the rig is of. Landmarks of the other hand, if their file says so,
        are mirrored.

    Returns
    -------
    dict of str to dict of str to float
        Angles in rad by frame and angle name.

    Raises
    ------
    InputError
        If the file is wrong, the rig has too few fingers to place a palm, or the landmarks' palm differs from
        the rig's.
    """
    return landmark_angles(read_landmarks(path), rig, hand, path)


def landmark_angles(
    landmarks: HandLandmarks, rig: Rig, hand: Hand = "right", source: str | Path = "landmarks"
) -> dict[str, Angles]:
    """As `read_landmark_angles`, of landmarks in memory."""
    where = LandmarkMap.of_rig(rig).with_wrist(rig)
    mirror = np.array([-1.0, 1, 1]) if landmarks.hand not in (None, hand) else np.ones(3)
    frames: dict[str, Angles] = {}
    angles: Angles = {}
    options = ReachOptions(rest_weight=REST_WEIGHT, tolerance=TOLERANCE)
    for name, points in zip(landmarks.names, landmarks.points * mirror, strict=True):
        seen = dict(zip(LANDMARKS, points, strict=True))
        angles = fit_points(seen, rig, where, angles, options, f"{source}: {name}").angles
        frames[name] = angles
    return frames


def fit_points(
    seen: Mapping[str, Array], rig: Rig, where: LandmarkMap, start: Angles, options: ReachOptions, source: str
) -> LandmarkFit:
    """Angles that bring the rig's bones nearest to landmarks (3,) by name, from initial angles in rad."""
    angles, seen = start, directed({name: seen[name] for name in where.places})
    # The palm's moving bones are first taken as in the start, then where the last answer has them.
    for _ in range(ROUNDS):
        before = dict.fromkeys(rig.angle_names, 0.0) | angles
        placed = _place_palm(seen, rig, where, angles, source)
        targets = _targets(placed, rig, where)
        found = solve(rig, targets, start=angles, options=options)
        angles = found.angles
        turned = max((abs(angles[name] - before[name]) for name in angles), default=0.0)
        if turned < SETTLED:
            break
    else:
        log.warning("%s: angles still change by %.2g deg", source, np.degrees(turned))
    return LandmarkFit.measure(found, targets)


def _place_palm(
    seen: Mapping[str, Array], rig: Rig, where: LandmarkMap, angles: Angles, source: str
) -> dict[str, Array]:
    """Landmarks scaled, turned and moved to where the rig's palm is, in mm."""
    bones = rig.bone_transforms(dict.fromkeys(rig.angle_names, 0.0) | angles)
    palm = where.palm(rig)
    carried = directed({name: bones[bone](point) for name, (bone, point) in where.places.items()})
    ours = np.array([carried[n] for n in palm])
    theirs = np.array([seen[n] for n in palm])
    weights = np.array([*palm.values()])
    _check_spread(ours, source, "the rig")
    _check_spread(theirs, source, "the landmarks")
    middle = weights @ theirs / weights.sum()
    spread = _spread(ours, weights)
    scale = spread / _spread(theirs, weights)
    fit = RigidTransform.fit(scale * (theirs - middle), ours, weights)
    error = np.sqrt(weights @ ((fit(scale * (theirs - middle)) - ours) ** 2).sum(axis=1) / weights.sum())
    if error > PALM_ERROR * spread:
        problem = f"the palm's landmarks are {error:.0f} mm off the rig's"
        raise InputError(source, "landmarks", problem, "Check that they are of a hand, in MediaPipe's order")
    return {n: fit((scale * (p - middle))[None])[0] for n, p in seen.items()}


def _rigid(rig: Rig, bone: str) -> bool:
    """Whether a bone moves with the root."""
    joints = {j.child: j for j in rig.joints}
    while bone != rig.root:
        if joints[bone].angles:
            return False
        bone = joints[bone].parent
    return True


def _spread(points: Array, weights: Array) -> float:
    middle = weights @ points / weights.sum()
    return float(np.sqrt(weights @ ((points - middle) ** 2).sum(axis=1) / weights.sum()))


def _check_spread(points: Array, source: str, whose: str) -> None:
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) if len(points) > 2 else np.zeros(2)
    if not sizes[1] > NARROW * sizes[0]:
        problem = f"{whose} has too little of a palm to place it by"
        raise InputError(source, "palm", problem, "At least three fingers, the thumb among them, are needed")


def _targets(placed: Mapping[str, Array], rig: Rig, where: LandmarkMap) -> Sequence[Target]:
    targets: list[Target] = []
    for name, (bone, point) in where.places.items():
        if not _rigid(rig, bone):
            targets.append(Position(bone, point, placed[name], LEAN))
    for first, second in where.segments.values():
        theirs = placed[second] - placed[first]
        length = float(np.linalg.norm(theirs))
        if length > 0:
            targets.append(Direction(*where.places[first], *where.places[second], theirs / length))
    return targets
