"""Levels learned from simulated frames, and their errors on frames that were left out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.hand import SimulatedFrame
from handpipe.hand.exports import BONES_A_VERTEX
from handpipe.levels.alarm import Alarm
from handpipe.levels.blend_weights import fit_weights
from handpipe.levels.correctives import Skinned, before_skinning, learn_correctives, single
from handpipe.levels.fast_skeleton import FastSkeleton
from handpipe.levels.joint_neighbours import driving_angles, moving_bones
from handpipe.levels.learned_hand import LEVELS, Errors, LearnedBody, LearnedHand, Level
from handpipe.levels.training_set import RIGID_LAYER, Body, TrainingSet
from handpipe.skeleton.posing import bone_weights
from handpipe.skeleton.rig import Rig

log = logging.getLogger(__name__)
LEAST_FRAMES = 10  # of which levels are learned
EVERY = 5  # frames, of which one is left out for the stated errors


def learn(
    frames: Sequence[SimulatedFrame] | TrainingSet, rig: Rig, source: str | Path = "frames"
) -> LearnedHand:
    """Learn both levels from simulated frames.

    Every fifth frame is left out for the errors that the hand states; the others choose and fit everything.

    Parameters
    ----------
    frames : sequence of SimulatedFrame or TrainingSet
        Frames at poses that cover what the hand is to show.
    rig : Rig
        Joints and neutral bone surfaces.
    source : path
        What an error names.

    Returns
    -------
    LearnedHand
        Hand with the bodies of the frames, and the bones.

    Raises
    ------
    InputError
        With fewer than ten frames, or frames that differ in bodies or do not suit the rig.
    """
    found = frames if isinstance(frames, TrainingSet) else TrainingSet.of(frames, str(source))
    if len(found) < LEAST_FRAMES:
        problem = f"are {len(found)}; levels are learned from {LEAST_FRAMES} or more"
        raise InputError(source, "frames", problem, "Simulate a scene of random poses with more frames")
    if set(found.angle_names) != set(rig.angle_names) or set(found.bones) != set(rig.bones):
        raise InputError(source, "frames", "have other joints than the rig", "Build both anew")
    found = _in_order_of(found, rig)
    left_out = np.arange(len(found)) % EVERY == EVERY - 1
    return _judged(_fitted(found.chosen(~left_out), rig), found.chosen(left_out))


def _in_order_of(found: TrainingSet, rig: Rig) -> TrainingSet:
    """The frames with angles and bones in the rig's order."""
    return replace(
        found,
        angle_names=rig.angle_names,
        bones=rig.bones,
        angles=found.angles[:, [found.angle_names.index(name) for name in rig.angle_names]],
        motions=found.motions[:, [found.bones.index(bone) for bone in rig.bones]],
    )


def _fitted(found: TrainingSet, rig: Rig) -> LearnedHand:
    """A hand of all of the frames, without errors."""
    moving = moving_bones(rig)
    placed = {body: _weights(found, body, rig, moving) for body in found.bodies}
    bodies = {
        body: LearnedBody(shape.rest, shape.cells, shape.fields) for body, shape in found.bodies.items()
    }
    joints = np.concatenate([np.zeros((0, BONES_A_VERTEX), np.int64), *(j for j, _ in placed.values())])
    weights = np.concatenate([np.zeros((0, BONES_A_VERTEX)), *(w for _, w in placed.values())])
    rest = np.concatenate([np.zeros((0, 3)), *(body.rest for body in bodies.values())])
    moved = np.concatenate(
        [np.zeros((len(found), 0, 3)), *(b.vertices for b in found.bodies.values())], axis=1
    )
    corrections = np.stack(
        [single(before_skinning(rest, x, joints, weights, m))
         for x, m in zip(moved, found.motions, strict=True)]
    )  # fmt: skip
    layers = [*dict.fromkeys(layer for layer, _ in bodies)]
    groups = [np.full(len(b.rest), layers.index(layer)) for (layer, _), b in bodies.items()]
    together = np.concatenate([np.zeros(0, np.int64), *groups])
    correctives = learn_correctives(
        Skinned(rest, together, joints, weights, corrections), found.angles, driving_angles(rig)
    )
    skeleton, alarm = FastSkeleton.of(rig), Alarm.of(found.angles, correctives)
    linear = np.zeros(len(rest), np.bool_)
    hand = LearnedHand(
        skeleton, rig.angle_names, rig.bones, bodies, joints, weights, linear, correctives, alarm
    )
    return _with_bones(replace(hand, dual=_better_by_duals(hand, found)), rig)


def _better_by_duals(hand: LearnedHand, found: TrainingSet) -> BoolArray:
    """Vertices (n,) of the bodies that dual quaternions bring nearer to the frames than matrices."""
    errors = []
    for chosen in (hand, replace(hand, dual=~hand.dual)):
        away = _distances(chosen, found, "L0")
        errors.append({body: float(np.mean(distances)) for body, distances in away.items()})
    better = [np.full(len(hand.bodies[b].rest), errors[1][b] < errors[0][b]) for b in hand.bodies]
    log.info("L0 takes dual quaternions in %d of %d bodies", sum(bool(b.any()) for b in better), len(better))
    return np.concatenate([np.zeros(0, np.bool_), *better])


def _distances(hand: LearnedHand, frames: TrainingSet, level: Level) -> dict[Body, list[Array]]:
    """Distances (n,) in mm of each body's vertices from those of the frames, frame by frame."""
    away: dict[Body, list[Array]] = {body: [] for body in frames.bodies}
    for number in range(len(frames)):
        x = hand.split(hand.moved(frames.motions[number], frames.angles[number], level))
        for body, shape in frames.bodies.items():
            away[body].append(np.linalg.norm(x[body] - shape.vertices[number], axis=1))
    return away


def _weights(found: TrainingSet, body: Body, rig: Rig, moving: IntArray) -> tuple[IntArray, Array]:
    """Bones (n, 4) that move by themselves and their weights (n, 4) for a body's vertices."""
    shape, owners = found.bodies[body], np.unique(moving)
    near = bone_weights(shape.rest, {bone: rig.surfaces[bone] for bone in rig.bones})
    before = np.stack([near[:, moving == owner].sum(axis=1) for owner in owners], axis=1)
    joints, weights = fit_weights(shape.rest, shape.vertices, found.motions[:, owners], before)
    return owners[joints], weights


def _with_bones(hand: LearnedHand, rig: Rig) -> LearnedHand:
    """The hand with the bones themselves, each on its own motion alone."""
    bodies, joints, weights = dict(hand.bodies), [hand.joints], [hand.weights]
    for number, bone in enumerate(rig.bones):
        surface = rig.surfaces[bone]
        count = len(surface.vertices)
        bodies[RIGID_LAYER, bone] = LearnedBody(surface.vertices, surface.triangles, {})
        joints.append(np.pad(np.full((count, 1), number), [(0, 0), (0, BONES_A_VERTEX - 1)]))
        weights.append(np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))
    return replace(
        hand,
        bodies=bodies,
        joints=np.concatenate(joints),
        weights=np.concatenate(weights),
        dual=np.pad(hand.dual, (0, sum(len(w) for w in weights[1:]))),
        correctives=hand.correctives.with_plain(sum(len(w) for w in weights[1:])),
    )


def _judged(hand: LearnedHand, left_out: TrainingSet) -> LearnedHand:
    """The hand with its errors on frames that were left out."""
    bodies = dict(hand.bodies)
    for level in LEVELS:
        for body, distances in _distances(hand, left_out, level).items():
            errors = Errors(float(np.mean(distances)), float(np.max(distances)), len(distances))
            bodies[body] = replace(bodies[body], errors={**bodies[body].errors, level: errors})
    return replace(hand, bodies=bodies)
