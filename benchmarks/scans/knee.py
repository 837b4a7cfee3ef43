"""A real knee in two poses: bones against intensities, the axis of its joint, its skin bent (no truth exists).

Each figure in voxels or mm of the limb, whose voxels are `unit` mm by an estimate of the data's README.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.scans.intensities import apart, bends, registered
from benchmarks.scans.knee_build import BENT, SETS, STRAIGHT, Knee
from benchmarks.scans.knee_skin import bent_skin, rig_of
from handpipe.core import RigidTransform, metrics

WAYS = ((STRAIGHT, BENT), (BENT, STRAIGHT))
BEND = 20.0  # deg about the knee's rough axis between the poses: a start beside the identity
Motions = Mapping[tuple[str, str, str], RigidTransform]


def measure(results: Path) -> metrics.Metrics:
    """Figures of the knee; none where its images are absent.

    results: folder in which `knee-{strokes}` keep the builds of both sets of strokes.
    """
    if Knee.absent():
        return {}
    results.mkdir(parents=True, exist_ok=True)
    knees = {name: Knee.build(results / f"knee-{name}", name) for name in SETS}
    found = {name: motions(knee) for name, knee in knees.items()}
    reference = by_intensities(knees[SETS[0]])
    return differences(knees[SETS[0]], found, reference) | axes(knees) | skin(knees[SETS[0]])


def motions(knee: Knee) -> Motions:
    """Registered motions of the bones by the pose from which, the pose to which, and the bone."""
    return {
        (source, target, bone): registration.transform
        for source, target in WAYS
        for bone, registration in knee.registered(source, target).items()
        if not registration.doubt
    }


def by_intensities(knee: Knee) -> Motions:
    """The same by the images' intensities in each bone's region."""
    found = {}
    for source, target in WAYS:
        fixed, moving, sign = knee.volume(source), knee.volume(target), 1 if source == STRAIGHT else -1
        for bone in knee.surfaces(source):
            middle = knee.middle(source, bone)
            starts = bends(middle, np.array([0.0, -sign * BEND]), [np.zeros(3)])
            match = registered(fixed, moving, knee.region(source, bone), starts)
            found[source, target, bone] = match.motion
    return found


def differences(knee: Knee, found: Mapping[str, Motions], reference: Motions) -> metrics.Metrics:
    """Angles and distances between registrations and the reference, and between the sets of strokes."""
    voxel, figures = float(knee.volume(STRAIGHT).spacing.max()), metrics.Metrics()
    turns, shifts, spreads = [], [], []
    for key, motion in reference.items():
        middle = knee.middle(key[0], key[2])
        here = [motions[key] for motions in found.values() if key in motions]
        off = [apart(motion, other, middle) for other in here]
        turns += [angle for angle, _ in off]
        shifts += [distance / voxel for _, distance in off]
        if len(here) > 1:
            spreads.append(apart(*here, middle))
        if off:
            name = f"{key[2]}_{key[0]}_to_{key[1]}"
            figures[f"knee_rotation_difference_{name}"] = (max(angle for angle, _ in off), "deg")
            figures[f"knee_shift_difference_voxels_{name}"] = (max(d for _, d in off) / voxel, "1")
    return figures | {
        "knee_motions_compared": (float(len(turns)), "1"),
        "knee_rotation_difference_max": (max(turns), "deg"),
        "knee_shift_difference_max_voxels": (max(shifts), "1"),
        "knee_strokes_rotation_spread": (max(angle for angle, _ in spreads), "deg"),
        "knee_strokes_shift_spread_voxels": (max(d for _, d in spreads) / voxel, "1"),
    }


def axes(knees: Mapping[str, Knee]) -> metrics.Metrics:
    """The knee's axis from its one motion: how far it may be off, and how far the sets of strokes differ."""
    rigs = [rig_of(knee) for knee in knees.values()]
    shrunk = next(iter(knees.values())).dataset.images.shrunk  # type: ignore[union-attr]
    joints = [next(joint for joint in rig.joints if joint.name == "knee") for rig in rigs]
    directions = [joint.fit.axes.directions[0] for joint in joints]
    between = np.degrees(np.arccos(min(abs(float(directions[0] @ directions[1])), 1.0)))
    knowledge = [joint.knowledge for joint in joints if joint.knowledge is not None]
    angles = [np.degrees(rig.poses[BENT].angles["knee_flexion"]) for rig in rigs]
    return {
        "knee_flexion": (float(np.mean(angles)), "deg"),
        "knee_axis_uncertainty": (float(np.degrees(max(k.axes.max() for k in knowledge))), "deg"),
        "knee_axis_told": (float(all(k.axes_told.all() for k in knowledge)), "1"),
        "knee_axis_place_uncertainty": (max(k.centre for k in knowledge) * shrunk, "mm"),
        "knee_axis_strokes_spread": (float(between), "deg"),
    }


def skin(knee: Knee) -> metrics.Metrics:
    """The skin simulated from straight to bent against that of the bent image, and without any simulation."""
    assert knee.dataset.images is not None
    bent, shrunk = bent_skin(knee), knee.dataset.images.shrunk
    return {
        "knee_skin_error_mean": (float(bent.errors.mean()) * shrunk, "mm"),
        "knee_skin_error_median": (float(np.median(bent.errors)) * shrunk, "mm"),
        "knee_skin_error_largest_twentieth": (float(np.quantile(bent.errors, 0.95)) * shrunk, "mm"),
        "knee_skin_unbent_error_mean": (float(bent.before.mean()) * shrunk, "mm"),
        "knee_skin_compared": (float(bent.compared.mean()), "1"),
    }
