"""A real knee in two poses: bones against intensities, its joint's axis, its skin bent (no truth exists).

Each figure in voxels or mm of the limb, whose voxels are `unit` mm by an estimate of the data's README.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.scans.intensities import apart, bends, registered
from benchmarks.scans.knee_build import BENT, SETS, STRAIGHT, Knee
from benchmarks.scans.knee_skin import bent_skin, rig_of
from handpipe.core import Array, RigidTransform, metrics

LONG = ("femur", "tibia")  # the others' rolls are told neither by their surfaces nor by intensities alone
WAYS = ((STRAIGHT, BENT), (BENT, STRAIGHT))
BENDS = np.arange(-24.0, 25.0, 8.0)  # deg about the knee's rough axis: starts of the reference, either way
SHIFTS = [np.array([x, 0.0, z]) for x in np.arange(-9.0, 10.0, 3.0) for z in np.arange(-9.0, 10.0, 3.0)]  # mm
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
        fixed, moving = knee.volume(source), knee.volume(target)
        for bone in knee.surfaces(source):
            middle = knee.middle(source, bone)
            starts = bends(middle, BENDS, SHIFTS)
            match = registered(fixed, moving, knee.region(source, bone), starts)
            found[source, target, bone] = match.motion
    return found


def symmetric(reference: Motions, middles: Mapping[tuple[str, str, str], Array]) -> Motions:
    """The mean of the reference's both ways, which differ by what its region and its interpolation do."""
    found = {}
    for (source, target, bone), motion in reference.items():
        middle = middles[source, target, bone]
        other = reference[target, source, bone].inverse() if (target, source, bone) in reference else motion
        half = Rotation.from_matrix(motion.rotation.T @ other.rotation).as_rotvec() / 2
        rotation = motion.rotation @ Rotation.from_rotvec(half).as_matrix()
        place = (motion(middle) + other(middle)) / 2
        found[source, target, bone] = RigidTransform(rotation, place - rotation @ middle)
    return found


def differences(knee: Knee, found: Mapping[str, Motions], reference: Motions) -> metrics.Metrics:
    """Angles and distances between registrations and the reference, and between the sets of strokes."""
    voxel = float(knee.volume(STRAIGHT).spacing.max())
    middles = {key: knee.middle(key[0], key[2]) for key in reference}
    means = symmetric(reference, middles)
    rows: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for key, motion in means.items():
        here = [motions[key] for motions in found.values() if key in motions]
        row = rows.setdefault(key[2], {"difference": [], "reference_spread": [], "strokes_spread": []})
        row["difference"] += [apart(motion, other, middles[key]) for other in here]
        row["reference_spread"].append(_doubled(apart(motion, reference[key], middles[key])))
        row["strokes_spread"] += [apart(here[0], here[1], middles[key])] if len(here) == 2 else []
    figures: metrics.Metrics = {}
    for bone, row in rows.items():
        for kind, pairs in row.items():
            angle, distance = np.max(pairs, axis=0)
            figures[f"knee_{bone}_rotation_{kind}"] = (float(angle), "deg")
            figures[f"knee_{bone}_shift_{kind}_voxels"] = (float(distance) / voxel, "1")
    for what, unit in (("rotation_difference", "deg"), ("shift_difference_voxels", "1")):
        head, tail = what.split("_", 1)
        of = {bone: figures[f"knee_{bone}_{what}"][0] for bone in rows}
        name = f"knee_{head}_{tail.replace('_voxels', '')}_max" + ("_voxels" if "voxels" in tail else "")
        figures[name] = (max(v for b, v in of.items() if b in LONG), unit)
        figures[name.replace("_max", "_small_bones_max")] = (
            max(v for b, v in of.items() if b not in LONG),
            unit,
        )
    return figures | {"knee_motions_compared": (float(sum(len(r["difference"]) for r in rows.values())), "1")}


def _doubled(pair: tuple[float, float]) -> tuple[float, float]:
    return 2 * pair[0], 2 * pair[1]


def axes(knees: Mapping[str, Knee]) -> metrics.Metrics:
    """The knee's axis from its one motion: how far it may be off, and how far the sets of strokes differ."""
    rigs = [rig_of(knee) for knee in knees.values()]
    shrunk = next(iter(knees.values())).dataset.limb.shrunk  # type: ignore[union-attr]
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
    assert knee.dataset.limb is not None
    bent, shrunk = bent_skin(knee), knee.dataset.limb.shrunk
    return {
        "knee_skin_error_mean": (float(bent.errors.mean()) * shrunk, "mm"),
        "knee_skin_error_median": (float(np.median(bent.errors)) * shrunk, "mm"),
        "knee_skin_error_largest_twentieth": (float(np.quantile(bent.errors, 0.95)) * shrunk, "mm"),
        "knee_skin_unbent_error_mean": (float(bent.before.mean()) * shrunk, "mm"),
        "knee_skin_compared": (float(bent.compared.mean()), "1"),
    }
