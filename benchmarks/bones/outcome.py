"""What the library makes of a case: images to rig in this process, and the errors against truth."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from benchmarks.bones.cases import Case, Place
from benchmarks.bones.chain import Registered, Segmented, register, segment
from benchmarks.bones.errors import motion_error, overlap
from benchmarks.bones.notices import listening
from benchmarks.bones.subject import NEUTRAL, PHALANGES, Conditions, Part, scan
from handpipe.core import InputError, Metrics
from handpipe.imaging.segmentation import SegmentationSettings
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration import without_odd_bones
from handpipe.skeleton.rig import Rig, joint_table

log = logging.getLogger(__name__)

SETTINGS = SegmentationSettings.model_validate({})


@dataclass(frozen=True)
class BoneErrors:
    """Of one bone in one pose against truth, in deg and mm; None of what was not found.

    dice: of the whole bone in neutral, of its marrow in other poses. stated: deviations of the rotation and
    the translation that the registration expects of itself.
    """

    dice: float | None
    rotation: float | None
    translation: float | None
    stated: tuple[float, float] | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    errors: of every bone in every pose; said: what the library said of them; rig: the figures of its table,
    none where no rig could be fitted; rig_said: what was said meanwhile; left_out: places that the rig did
    not learn from; seconds: the processor's for all poses and the rig.
    """

    errors: dict[Place, BoneErrors]
    said: dict[Place, list[str]]
    rig: Metrics
    rig_said: list[str]
    left_out: frozenset[Place]
    seconds: float


@cache
def segmented(
    bones: tuple[str, ...],
    neutral: Conditions,
    conditions: Conditions,
    pose: str,
    settings: SegmentationSettings,
) -> Segmented:
    """The bones of one pose; cases that share it do not repeat it. neutral: conditions of neutral."""
    rest = None if pose == NEUTRAL else segmented(bones, neutral, neutral, NEUTRAL, settings)
    return segment(scan(bones, conditions, pose), settings, rest)


@cache
def registered(
    bones: tuple[str, ...],
    neutral: Conditions,
    conditions: Conditions,
    pose: str,
    settings: SegmentationSettings,
) -> Registered:
    """The bones of one pose, registered from neutral."""
    rest = segmented(bones, neutral, neutral, NEUTRAL, settings)
    dataset = Part(bones).dataset(conditions.hand)
    return register(dataset, rest, segmented(bones, neutral, conditions, pose, settings))


def run(case: Case, part: Part = PHALANGES, settings: SegmentationSettings = SETTINGS) -> Outcome:
    """Images to rig under a case's conditions, on a part of the hand; poses are those that both name."""
    poses = tuple(p for p in case.poses if p in part.poses)
    part = Part(part.bones, poses)
    errors: dict[Place, BoneErrors] = {}
    said: dict[Place, list[str]] = {}
    left_out: set[Place] = set()
    trusted: dict[str, dict[str, Registration]] = {}
    seconds = 0.0
    for pose in poses:
        given = (part.bones, case.in_pose(NEUTRAL), case.in_pose(pose), pose, settings)
        bones, motions = segmented(*given), registered(*given)
        trusted[pose] = motions.trusted()
        for notes in (bones.notes, motions.notes):
            seconds += notes.seconds
            for bone, texts in notes.said.items():
                said.setdefault((pose, bone), []).extend(texts)
        left_out |= {(pose, bone) for bone in part.bones if bone not in trusted[pose]}
        errors |= _pose_errors(case, part, pose, bones, motions)
        log.info("%s: %s: %.1f + %.1f s", case.name, pose, bones.notes.seconds, motions.notes.seconds)
    rig: Metrics = {}
    odd: dict[Place, str] = {}
    rig_said: list[str] = []
    begun = time.process_time()
    with listening(rig_said):
        odd, rig = _rig(case, part, trusted, settings)
    seconds += time.process_time() - begun
    for place, text in odd.items():
        said.setdefault(place, []).append(text)
    return Outcome(errors, said, rig, rig_said, frozenset(left_out | set(odd)), seconds)


def _pose_errors(
    case: Case, part: Part, pose: str, bones: Segmented, motions: Registered
) -> dict[Place, BoneErrors]:
    """Errors of every bone in a pose."""
    image = scan(part.bones, case.in_pose(pose), pose)
    found = bones.whole if pose == NEUTRAL else bones.marrow
    true = image.posed.bones if pose == NEUTRAL else image.posed.marrow
    errors = {}
    for bone in part.bones:
        dice = overlap(found[bone], true[bone], image) if bone in found else None
        errors[pose, bone] = BoneErrors(dice, None, None)
        if pose != NEUTRAL and bone in motions.found:
            found_motion = motions.found[bone]
            centroid = scan(part.bones, case.in_pose(NEUTRAL), NEUTRAL).posed.bones[bone][0].mean(axis=0)
            apart = motion_error(found_motion.transform, image.posed.transforms[bone], centroid)
            stated = (found_motion.rotation_deviation, found_motion.translation_deviation)
            errors[pose, bone] = BoneErrors(dice, *apart, stated)
    return errors


def _rig(
    case: Case, part: Part, trusted: Mapping[str, Mapping[str, Registration]], settings: SegmentationSettings
) -> tuple[dict[Place, str], Metrics]:
    """Fit the rig to all poses, as `fit_rig` does: odd bones, and errors on fitted and on left-out poses."""
    dataset = part.dataset(case.conditions.hand)
    rest = case.in_pose(NEUTRAL)
    surfaces = segmented(part.bones, rest, rest, NEUTRAL, settings).whole
    if lost := [bone for bone in part.bones if bone not in surfaces]:
        raise InputError(
            NEUTRAL, "bones", f"{', '.join(lost)} not found", "The neutral pose needs every bone"
        )
    found = {pose: {bone: r.transform for bone, r in bones.items()} for pose, bones in trusted.items()}
    transforms, odd = without_odd_bones(dataset, found, surfaces, part.poses)
    rig = Rig.fit(dataset, transforms, surfaces, part.poses, trusted)
    return odd, joint_table(rig, dataset, transforms, part.poses, trusted).metrics
