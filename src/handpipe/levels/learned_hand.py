"""A hand that is learned from simulated frames: weights (L0), and correctives driven by joint angles (L1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handpipe.core import Array, BoolArray, Frame, InputError, Int32Array, IntArray, Shape, Shapes, artifacts
from handpipe.levels import kernels
from handpipe.levels.alarm import Alarm
from handpipe.levels.correctives import Correctives, single
from handpipe.levels.fast_skeleton import FastSkeleton
from handpipe.levels.training_set import Body

Level = Literal["L0", "L1"]
LEVELS: tuple[Level, ...] = ("L0", "L1")
KIND = "levels"


@dataclass(frozen=True, eq=False)
class Errors:
    """Distances in mm of a body's vertices from simulated frames that were left out.

    Parameters
    ----------
    mean : float
        Mean over frames and vertices.
    largest : float
        Of any vertex in any of the frames.
    frames : int
        Number of frames.
    """

    mean: float
    largest: float
    frames: int


@dataclass(frozen=True, eq=False)
class LearnedBody:
    """A body's neutral surface, its place among all vertices, and the errors of each level.

    Parameters
    ----------
    rest : array (n, 3)
        Neutral vertices, mm.
    cells : array (k, 3) or (k, 2) of int
        Triangles or segments.
    fields : mapping of str to array
        Values over points or cells.
    errors : mapping of str to Errors
        By level; empty for bones, which are exact.
    """

    rest: Array
    cells: IntArray
    fields: Mapping[str, Array]
    errors: Mapping[str, Errors] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LearnedHand:
    """Joint angles to vertices in milliseconds.

    Parameters
    ----------
    skeleton : FastSkeleton
        Joints.
    angle_names, bones : tuple of str
        Names in the order of the rig.
    bodies : mapping of (str, str) to LearnedBody
        Bodies by layer and name, in the order of their vertices.
    joints : array (n, 4) of int
        Bones of all vertices.
    weights : array (n, 4)
        Their weights, by falling weight.
    dual : array (n,) of bool
        Where L0 blends dual quaternions and not matrices: in bodies that it brings nearer to learned frames.
    correctives : Correctives
        What L1 adds in neutral, before linear blending.
    alarm : Alarm
        Which poses are like the learned ones.
    """

    skeleton: FastSkeleton
    angle_names: tuple[str, ...]
    bones: tuple[str, ...]
    bodies: Mapping[Body, LearnedBody]
    joints: IntArray
    weights: Array
    dual: BoolArray
    correctives: Correctives
    alarm: Alarm

    @cached_property
    def rest(self) -> Array:
        """Neutral vertices (n, 3) of all bodies in mm, in single precision."""
        found = [np.zeros((0, 3)), *(body.rest for body in self.bodies.values())]
        return single(np.concatenate(found))

    @cached_property
    def _dual(self) -> IntArray:
        """Numbers of the vertices that L0 moves by dual quaternions."""
        return np.flatnonzero(self.dual)

    @cached_property
    def _single(self) -> tuple[Int32Array, Array]:
        """Bones and weights of all vertices as the compiled loops take them."""
        return np.ascontiguousarray(self.joints, np.int32), single(self.weights)

    def only(self, wanted: Callable[[Body], bool]) -> LearnedHand:
        """The same hand with some of its bodies: what a scene does not need is not computed.

        Parameters
        ----------
        wanted : callable
            Whether a body is kept, by its layer and name.

        Returns
        -------
        LearnedHand
            Hand of these bodies.
        """
        ends = np.cumsum([0, *(len(body.rest) for body in self.bodies.values())])
        kept = [
            (name, np.arange(a, b))
            for name, a, b in zip(self.bodies, ends[:-1], ends[1:], strict=True)
            if wanted(name)
        ]
        which = np.concatenate([np.zeros(0, np.int64), *(numbers for _, numbers in kept)])
        return replace(
            self,
            bodies={name: self.bodies[name] for name, _ in kept},
            joints=self.joints[which],
            weights=self.weights[which],
            dual=self.dual[which],
            correctives=self.correctives.of_vertices(which),
        )

    def vertices(self, angles: Array, level: Level = "L1") -> Array:
        """Vertices (n, 3) in mm of all bodies, in single precision, at angles (a,) in rad; root at rest."""
        return self.moved(self.skeleton.motions(angles), angles, level)

    def moved(self, motions: Array, angles: Array, level: Level) -> Array:
        """As `vertices`, with given motions (b, 3, 4) of the bones."""
        rest, out, moves = self.rest, np.empty_like(self.rest), single(motions)
        if level == "L1":
            points = np.empty_like(rest)
            self.correctives.add(rest, angles, points)
            kernels.skin(points, *self._single, moves, out)
            return out
        kernels.skin(rest, *self._single, moves, out)
        if len(self._dual):
            duals = np.zeros((len(motions), 8))
            kernels.dual_quaternions(motions, duals)
            kernels.skin_dual(rest, *self._single, single(duals), self._dual, out)
        return out

    def split(self, vertices: Array) -> dict[Body, Array]:
        """Vertices (n, 3) of all bodies by body."""
        ends = np.cumsum([len(body.rest) for body in self.bodies.values()])
        return dict(zip(self.bodies, np.split(vertices, ends[:-1]), strict=True))

    def distance(self, angles: Array) -> float:
        """How far angles (a,) in rad are from the learned ones; above 1 the stated errors do not hold."""
        return self.alarm.distance(angles, self.correctives)

    def angles_of(self, angles: Mapping[str, float]) -> Array:
        """Angles (a,) in the hand's order; raises `InputError` where one is missing."""
        missing = [name for name in self.angle_names if name not in angles]
        if missing:
            raise InputError("frame", missing[0], "is not given", "Give all angles of the rig")
        return np.array([angles[name] for name in self.angle_names], float)

    def frame(self, frame: Frame, level: Level) -> dict[str, Shapes]:
        """Shapes by layer and body in a frame.

        Parameters
        ----------
        frame : Frame
            Pose; the bones of its own count.
        level : str
            "L0" or "L1".

        Returns
        -------
        dict of str to dict of str to Shape
            Shapes with the figures `level_bound`, the largest error in mm of left-out frames, and
            `level_distance`, which above 1 says that the pose is unlike the learned ones.
        """
        angles = self.angles_of(frame.angles)
        motions = np.array([frame.bones[bone].matrix for bone in self.bones])
        distance = self.distance(angles)
        found: dict[str, Shapes] = {}
        for (layer, name), x in self.split(self.moved(motions, angles, level)).items():
            body = self.bodies[layer, name]
            figures = {}
            if body.errors:
                figures = {"level_bound": body.errors[level].largest, "level_distance": distance}
            shape = Shape(body.rest, x.astype(float), body.cells, dict(body.fields), figures)
            found.setdefault(layer, {})[name] = shape
        return found

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the hand as an artifact."""
        bodies: dict[str, Any] = {}
        for number, ((layer, name), body) in enumerate(self.bodies.items()):
            bodies[f"{number:04d}"] = {
                "layer": layer,
                "name": name,
                "rest": body.rest,
                "cells": body.cells,
                "fields": dict(body.fields),
                "errors": {level: vars(errors) for level, errors in body.errors.items()},
            }
        data = {
            "skeleton": self.skeleton.to_group(),
            "angle_names": list(self.angle_names),
            "bones": list(self.bones),
            "bodies": bodies,
            "joints": self.joints.astype(np.int32),
            "weights": single(self.weights),
            "dual": self.dual,
            "correctives": self.correctives.to_group(),
            "alarm": self.alarm.to_group(),
        }
        units = {f"bodies/{number}/rest": "mm" for number in bodies}
        units |= {f"alarm/{name}": "rad" for name in ("lower", "upper")}
        units |= {f"correctives/{n}": u for n, u in {"lower": "rad", "upper": "rad", "errors": "mm"}.items()}
        units |= {f"skeleton/{n}": "mm" for n in ("centres", "offsets", "shifts")}
        artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> LearnedHand:
        """Read a hand that `save` wrote; raises `InputError` for another file."""
        data = artifacts.read(path, KIND)
        bodies = {
            (str(g["layer"]), str(g["name"])): LearnedBody(
                g["rest"],
                g["cells"],
                dict(g.get("fields", {})),
                {
                    level: Errors(float(e["mean"]), float(e["largest"]), int(e["frames"]))
                    for level, e in g.get("errors", {}).items()
                },
            )
            for _, g in sorted(data["bodies"].items())
        }
        return LearnedHand(
            FastSkeleton.from_group(data["skeleton"]),
            tuple(data["angle_names"]),
            tuple(data["bones"]),
            bodies,
            data["joints"].astype(np.int64),
            data["weights"],
            data["dual"].astype(np.bool_),
            Correctives.from_group(data["correctives"]),
            Alarm.from_group(data["alarm"]),
        )
