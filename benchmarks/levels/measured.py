"""Seconds and errors of levels, errors by the number of learned frames, bounds and alarms."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.levels.subject import Subject
from handpipe.core import Array, Metrics
from handpipe.hand import simulate_frame, tissue
from handpipe.levels import LearnedHand, Level, TrainingSet, learn
from handpipe.mesh.surfaces import Distance, Surface

SHOWN = ("skin", "muscles", "tendons", "ligaments")
LEVELS: tuple[Level, ...] = ("L0", "L1")
REPEATS = 9  # of a timing, of which the median counts
SIMULATED = 3  # frames that are simulated again for their seconds
SHARES = (0.25, 0.5, 0.75, 1.0)  # of the frames, of which levels are learned for the curve
LOW, HIGH = 0.6, 0.8  # quantiles of an angle: learned below the one, outside above the other


def measured(subject: Subject) -> Metrics:
    """All figures of a subject."""
    hand, tested = subject.hand, subject.tested
    found: Metrics = {
        "frames_learned": (float(len(subject.learned)), "frames"),
        "frames_tested": (float(len(tested)), "frames"),
        "simulated_seconds": (_simulated_seconds(subject), "s"),
    }
    for level in LEVELS:
        found |= _errors(hand, tested, level)
    for name, dual in (("linear", np.zeros_like(hand.dual)), ("dual", np.ones_like(hand.dual))):
        found |= {
            f"{name}_{key}": value for key, value in _errors(replace(hand, dual=dual), tested, "L0").items()
        }
    found |= seconds(hand, tested.angles) | _curve(subject) | _bounds(hand, tested) | _alarms(subject)
    return found


def seconds(hand: LearnedHand, angles: Array) -> Metrics:
    """Seconds a frame: skeleton and skin, organs without bones, everything."""
    parts: dict[str, Callable[[tuple[str, str]], bool]] = {
        "skin": lambda body: body[1] == "skin",
        "organs": lambda body: body[0] != "bones",
        "everything": lambda body: True,
    }
    found: Metrics = {}
    for part, wanted in parts.items():
        some = hand.only(wanted)
        found[f"vertices_{part}"] = (float(len(some.rest)), "vertices")
        for level in LEVELS:
            found[f"{level.lower()}_{part}_seconds"] = (_median_seconds(some, angles, level), "s")
    found["alarm_seconds"] = (_timed(lambda: [hand.distance(a) for a in angles]) / len(angles), "s")
    return found


def _median_seconds(hand: LearnedHand, angles: Array, level: Level) -> float:
    return _timed(lambda: [hand.vertices(a, level) for a in angles]) / len(angles)


def _timed(run: Callable[[], object]) -> float:
    """Median of processor seconds, after a run that compiles."""
    run()
    found = []
    for _ in range(REPEATS):
        begun = time.process_time()
        run()
        found.append(time.process_time() - begun)
    return float(np.median(found))


def _simulated_seconds(subject: Subject) -> float:
    """Mean processor seconds of a simulated frame, after one that compiles."""
    layers, found = subject.layers(), []
    for frame, _ in subject.tested_frames(SIMULATED + 1):
        begun = time.process_time()
        simulate_frame(frame, layers)
        found.append(time.process_time() - begun)
    return float(np.mean(found[1:]))


def _of_tissue(hand: LearnedHand, frames: TrainingSet, number: int, level: Level, name: str) -> Array:
    """Distances (n,) in mm of a tissue's vertices from those of a frame."""
    x = hand.split(hand.moved(frames.motions[number], frames.angles[number], level))
    away = [
        np.linalg.norm(x[body] - shape.vertices[number], axis=1)
        for body, shape in frames.bodies.items()
        if tissue(*body) == name
    ]
    return np.concatenate([np.zeros(0), *away])


def _errors(hand: LearnedHand, tested: TrainingSet, level: Level) -> Metrics:
    """Mean and largest distance by tissue; of tendons also from their surface."""
    found: Metrics = {}
    for name in SHOWN:
        away = np.concatenate([_of_tissue(hand, tested, i, level, name) for i in range(len(tested))])
        if len(away):
            found[f"{level.lower()}_{name}_error_mean"] = (float(away.mean()), "mm")
            found[f"{level.lower()}_{name}_error_max"] = (float(away.max()), "mm")
    across = np.concatenate([_from_surfaces(hand, tested, i, level) for i in range(len(tested))])
    if len(across):
        found[f"{level.lower()}_tendons_surface_error_mean"] = (float(across.mean()), "mm")
        found[f"{level.lower()}_tendons_surface_error_max"] = (float(across.max()), "mm")
    return found


def _from_surfaces(hand: LearnedHand, frames: TrainingSet, number: int, level: Level) -> Array:
    """Distances (n,) in mm of tendons' vertices from their simulated surfaces: gliding does not count."""
    x = hand.split(hand.moved(frames.motions[number], frames.angles[number], level))
    found = [
        Distance(Surface(shape.vertices[number].astype(float), shape.cells)).closest(x[body].astype(float))[0]
        for body, shape in frames.bodies.items()
        if body[0] == "tendons"
    ]
    return np.concatenate([np.zeros(0), *found])


def _curve(subject: Subject) -> Metrics:
    """Mean error of L1's tissues by the number of learned frames."""
    found: Metrics = {}
    for share in SHARES:
        count = round(share * len(subject.learned))
        if count < 10:
            continue
        hand = learn(subject.learned.chosen(np.arange(count)), subject.rig, subject.scene)
        for name, (value, unit) in _errors(hand, subject.tested, "L1").items():
            if name.endswith("_mean"):
                found[f"{name}_{count}"] = (value, unit)
    return found


def _bounds(hand: LearnedHand, tested: TrainingSet) -> Metrics:
    """Share of tested frames and bodies within the stated errors, and the share that theory gives."""
    found: Metrics = {}
    frames = next(body.errors["L1"].frames for body in hand.bodies.values() if body.errors)
    found["covered_expected"] = (frames / (frames + 1), "1")
    for level in LEVELS:
        covered = []
        for i in range(len(tested)):
            x = hand.split(hand.moved(tested.motions[i], tested.angles[i], level))
            covered += [
                float(np.linalg.norm(x[body] - shape.vertices[i], axis=1).max())
                <= hand.bodies[body].errors[level].largest
                for body, shape in tested.bodies.items()
            ]
        found[f"{level.lower()}_covered"] = (float(np.mean(covered)), "1")
    return found


def _alarms(subject: Subject) -> Metrics:
    """Share of frames with an alarm: tested ones, and ones beyond what another hand was learned from."""
    hand, tested, whole = subject.hand, subject.tested, subject.whole
    widest = int(np.argmax(np.ptp(whole.angles, axis=0)))
    low, high = np.quantile(whole.angles[:, widest], (LOW, HIGH))
    part = learn(whole.chosen(whole.angles[:, widest] <= low), subject.rig, subject.scene)
    beyond = whole.chosen(whole.angles[:, widest] >= high)
    away = [np.mean(_of_tissue(part, beyond, i, "L1", "skin")) for i in range(len(beyond))]
    return {
        "alarms_inside": (_share(hand, tested.angles), "1"),
        "alarms_outside": (_share(part, beyond.angles), "1"),
        "outside_skin_error_mean": (float(np.mean(away)), "mm"),
    }


def _share(hand: LearnedHand, angles: Sequence[Array] | Array) -> float:
    return float(np.mean([hand.distance(a) > 1 for a in angles]))
