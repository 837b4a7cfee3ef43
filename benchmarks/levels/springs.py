"""Level L2, which is not learned: seconds and errors of bulging muscles and a skin of springs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.levels.subject import Subject
from handpipe.core import Array, Metrics, paths
from handpipe.core.configuration import load_dataset
from handpipe.hand import SimulatedFrame
from handpipe.levels import FastSkeleton
from handpipe.levels.mass_spring import SpringHand
from handpipe.tissues.fat import Skin
from handpipe.tissues.muscles import Muscle

REPEATS = 9  # of a timing, of which the median counts


def springs(subject: Subject) -> Metrics:
    """Figures of level L2 on the frames that the learned levels are tested on, and without its muscles."""
    frames = subject.tested_frames(len(subject.tested))
    whole, bare = spring_hand(subject), spring_hand(subject, muscles=False)
    found: Metrics = {
        "l2_muscles": (float(len(whole.muscles)), "muscles"),
        "l2_springs": (float(len(whole.springs.springs.ends)), "springs"),
    }
    motions = subject.tested.motions
    settled = [whole.posed(motion) for motion in motions]
    found["l2_iterations"] = (float(np.mean([skin.iterations for skin, _ in settled])), "iterations")
    errors = {
        "l2_skin": [_away(skin.nodes, frame) for (skin, _), frame in zip(settled, frames, strict=True)],
        "l2_muscles": [
            np.linalg.norm(bulge.vertices - frame[1]["muscles"][name].vertices, axis=1)
            for (_, muscles), frame in zip(settled, frames, strict=True)
            for name, bulge in muscles.items()
        ],
        "l2_bare_skin": [
            _away(bare.posed(m)[0].nodes, frame) for m, frame in zip(motions, frames, strict=True)
        ],
    }
    for name, away in errors.items():
        found |= _error(name, away)
    outside = [whole.frame(frame)["skin"]["skin"].figures["inner_overlap"] for frame, _ in frames]
    found["l2_inner_overlap_max"] = (max(outside), "mm")
    return found | _seconds(subject, whole, bare)


def spring_hand(subject: Subject, muscles: bool = True) -> SpringHand:
    """The hand of a built subject."""
    skin, given = skin_and_muscles(subject)
    return SpringHand.of(subject.rig, skin, given if muscles else [])


def skin_and_muscles(subject: Subject) -> tuple[Skin, list[Muscle]]:
    """The neutral skin and the muscles of a built subject."""
    below = paths.SUBJECT + "/"
    pattern = paths.MUSCLE_STRAINS.removeprefix(below)
    names = load_dataset(subject.dataset).muscles
    muscles = [Muscle.load(subject.folder / pattern.format(muscle=name)) for name in names]
    return Skin.load(subject.folder / paths.SKIN.removeprefix(below)), muscles


def _away(nodes: Array, frame: SimulatedFrame) -> Array:
    distances: Array = np.linalg.norm(nodes - frame[1]["fat"]["skin"].vertices, axis=1)
    return distances


def _error(name: str, away: Sequence[Array]) -> Metrics:
    every = np.concatenate(away)
    return {
        f"{name}_error_mean": (float(every.mean()), "mm"),
        f"{name}_error_max": (float(every.max()), "mm"),
    }


def _seconds(subject: Subject, whole: SpringHand, bare: SpringHand) -> Metrics:
    """Seconds from joint angles: skin without muscles; muscles and skin; these and the bones' vertices."""
    skeleton, angles = FastSkeleton.of(subject.rig), subject.tested.angles
    neutral = [surface.vertices for surface in whole.surfaces.values()]

    def everything(values: Array) -> None:
        motions = skeleton.motions(values)
        whole.posed(motions)
        for motion, x in zip(motions, neutral, strict=True):
            np.add(x @ motion[:, :3].T, motion[:, 3])

    found: Metrics = {}
    for name, run in (
        ("skin", lambda values: bare.posed(skeleton.motions(values))),
        ("organs", lambda values: whole.posed(skeleton.motions(values))),
        ("everything", everything),
    ):
        found[f"l2_{name}_seconds"] = (_timed(run, angles), "s")
    return found


def _timed(run: Callable[[Array], object], angles: Array) -> float:
    """Median over repeats of the mean processor seconds of a frame."""
    found = []
    for _ in range(REPEATS + 1):  # the first one compiles
        begun = time.process_time()
        for values in angles:
            run(values)
        found.append((time.process_time() - begun) / len(angles))
    return float(np.median(found[1:]))
