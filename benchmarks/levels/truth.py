"""Errors of every level against the truth of scanned poses: skin and muscles, example and held-out poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.levels.springs import spring_hand
from benchmarks.levels.subject import Subject
from handpipe.core import Array, Frame, IntArray, Metrics, RigidTransform, Shapes, metrics, paths
from handpipe.core.configuration import load_dataset
from handpipe.evaluation import surface_distance, surface_errors
from handpipe.hand import read_frames
from handpipe.levels import Level
from handpipe.mesh.surfaces import Surface
from handpipe.stages.truth import surfaces_in, true_pose
from handpipe.tissues.fat import Skin

LEARNED: tuple[Level, ...] = ("L0", "L1")
Shown = Mapping[str, Mapping[str, Surface]]  # skin and muscles by tissue and name


def against_truth(subject: Subject) -> Metrics:
    """Distances in mm to the true surfaces by level, tissue and role of the pose, as the build measures them.

    Empty without truth. `full` is the build's own simulation of the pose. The neutral pose does not count.
    """
    dataset, folder = load_dataset(subject.dataset), subject.folder
    truth = sorted((folder / paths.below(paths.TRUTH)).parent.glob("*.h5"))
    skin = Skin.load(folder / paths.below(paths.SKIN))
    cut = skin.rigid["cut_end"].vertices if "cut_end" in skin.rigid else np.zeros(0, int)
    springs, away = spring_hand(subject), dict[tuple[str, str, str], list[Array]]()
    for path in truth:
        pose = path.stem
        if pose == dataset.neutral or pose not in subject.rig.poses:
            continue
        role = dataset.poses[pose].role.value
        fitted = subject.rig.poses[pose]
        frame = Frame(pose, fitted.angles, subject.rig.bone_transforms(fitted.angles))
        true = _true(truth, pose, fitted.root.inverse())
        found: dict[str, Shown] = {level: _shown(subject.hand.frame(frame, level)) for level in LEARNED}
        found |= {"L2": _shown(springs.frame(frame)), "full": _built(subject, pose)}
        for level, shown in found.items():
            for tissue, distances in _distances(shown, true, cut).items():
                away.setdefault((level, tissue, role), []).append(distances)
    figures: Metrics = {}
    for (level, tissue, role), errors in away.items():
        named = metrics.summary(f"{level.lower()}_true_{tissue}_{role}", np.concatenate(errors), "mm")
        figures |= {name: value for name, value in named.items() if not name.endswith("_median")}
    return figures


def _distances(shown: Shown, true: Shown, cut: IntArray) -> dict[str, Array]:
    """Of the skin's vertices but its cut end to the true skin, and of the muscles' to the true muscles."""
    found = {
        "skin": surface_distance(np.delete(shown["skin"]["skin"].vertices, cut, 0), true["skin"]["skin"])
    }
    if shown["muscles"]:
        errors = surface_errors(shown["muscles"], {n: true["muscles"][n] for n in shown["muscles"]})
        found["muscles"] = np.concatenate([*errors.values()])
    return found


def _true(files: Sequence[Path], pose: str, home: RigidTransform) -> Shown:
    """True surfaces of a pose in the frame of the rig's root; home: from the scanner's frame to it."""
    known = true_pose(files, pose)
    muscles = surfaces_in(known["muscles"])
    skin = Surface(home(known["skin"]["vertices"]), known["skin"]["triangles"])
    return {"skin": {"skin": skin}, "muscles": {n: s.moved(home(s.vertices)) for n, s in muscles.items()}}


def _built(subject: Subject, pose: str) -> Shown:
    """The simulation of a scanned pose as the build has it: muscles, and the skin of the full model."""
    below = paths.SUBJECT + "/"
    files = [paths.at(p.removeprefix(below), pose=pose) for p in (paths.POSE_INNER, paths.POSE_SKIN)]
    [(_, inner)], [(_, models)] = (read_frames(subject.folder / file) for file in files)
    return _shown({"muscles": inner["muscles"], "skin": {"skin": models["m0"]["skin"]}})


def _shown(layers: Mapping[str, Shapes]) -> Shown:
    """Skin and muscles of a frame's layers, as surfaces."""
    found: dict[str, dict[str, Surface]] = {"skin": {}, "muscles": {}}
    for layer, shapes in layers.items():
        for name, shape in shapes.items():
            if name == "skin" or (layer == "muscles" and shape.cells.shape[1] == 3):
                found["skin" if name == "skin" else "muscles"][name] = Surface(shape.vertices, shape.cells)
    return found
