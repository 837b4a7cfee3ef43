"""Stated deviations against true errors in scanned poses: coverage by organ, example and held out."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, Frame, RigidTransform, Shapes, artifacts, metrics
from handpipe.core.configuration import Dataset, Role
from handpipe.evaluation import (
    Row,
    coverage,
    curve_distance,
    reliability_metrics,
    reliability_rows,
    surface_distance,
)
from handpipe.hand import read_frames
from handpipe.hand.deviations import HandDeviations
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.truth import true_motion, true_pose
from handpipe.tissues.fat import Skin
from handpipe.tissues.tendons import CENTRELINE

BY_ANGLES = "angles"
KINDS = {"bones": "bones", "tendons": "tendons", "muscles": "muscles", "fat": "skin"}  # by layer


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads; inner, skins: of the same scanned poses; truth: of all poses that have one."""

    rig: Path
    deviations: Path
    skin: Path | None
    inner: Sequence[Path]
    skins: Sequence[Path]
    truth: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


@dataclass(frozen=True)
class Compared:
    """A body in a scanned pose: errors and stated deviations (n,) in mm; errors are None without truth.

    role: of the pose; "angles" of a held-out one whose bones are taken as those of any frame, by its angles.
    """

    role: str
    pose: str
    kind: str
    body: str
    stated: Array
    errors: Array | None

    def as_row(self) -> dict[str, str | float]:
        """Root mean squares in mm and the coverage, of a table."""
        told: dict[str, str | float] = {
            "role": self.role,
            "pose": self.pose,
            "kind": self.kind,
            "body": self.body,
        }
        told["stated"] = float(np.sqrt(np.mean(self.stated**2)))
        if self.errors is not None:
            told["error"] = float(np.sqrt(np.mean(self.errors**2)))
            told["coverage"] = coverage(self.errors, self.stated)
        return told


def evaluate_deviations(inputs: Inputs, outputs: Outputs, dataset: Dataset) -> None:
    """Stated deviations against true errors in scanned poses: coverage by organ, example and held out."""
    found: metrics.Metrics = {}
    with metrics.measured(found):
        rows = compared(inputs, dataset)
    table: list[Row] = [{"group": 0.0, **row.as_row()} for row in rows]
    for role in dict.fromkeys(row.role for row in rows):
        of_role = [row for row in rows if row.role == role]
        known = [row for row in of_role if row.errors is not None]
        for kind in dict.fromkeys(row.kind for row in of_role):
            stated = np.concatenate([row.stated for row in of_role if row.kind == kind])
            errors = [row.errors for row in known if row.kind == kind and row.errors is not None]
            suffix = f"{role}_{kind}"
            if not errors:
                found[f"stated_{suffix}"] = (float(np.sqrt(np.mean(stated**2))), "mm")
                continue
            found |= reliability_metrics(np.concatenate(errors), stated, suffix)
            of_groups = reliability_rows(np.concatenate(errors), stated)
            table += [{"role": role, "kind": kind, **row} for row in of_groups]
        if known:
            # Meshes differ in size: each kind of organ counts alike.
            kinds = [found[n][0] for n in found if n.startswith(f"coverage_two_deviations_{role}_")]
            found[f"coverage_two_deviations_{role}"] = (float(np.mean(kinds)), "1")
    artifacts.write_text(outputs.table, json.dumps(table, indent=2))
    metrics.write(outputs.metrics, found)


def compared(inputs: Inputs, dataset: Dataset) -> list[Compared]:
    """Each body of each scanned pose with its stated deviations and its true errors."""
    rig, stated = Rig.load(inputs.rig), HandDeviations.load(inputs.deviations)
    skins = {path.parent.name: path for path in inputs.skins}
    cut = np.zeros(0, dtype=int)
    if inputs.skin is not None:
        rigid = Skin.load(inputs.skin).rigid
        cut = rigid["cut_end"].vertices if "cut_end" in rigid else cut
    found = []
    for path in inputs.inner:
        [(frame, below)] = read_frames(path)
        layers = dict(below)
        if frame.name in skins:
            layers["fat"] = read_frames(skins[frame.name])[0][1]["m0"]
        truth = None
        if dataset.truth is not None:
            truth = TruePose.read(inputs.truth, frame.name, rig.poses[frame.name].root.inverse())
        role = dataset.poses[frame.name].role
        bars = {role.value: stated.of_frame(rig, frame, layers, frame.name)}
        if role == Role.heldout:
            bars[BY_ANGLES] = stated.of_frame(rig, frame, layers)
        for layer, body in ((layer, body) for layer, bodies in bars[role.value].items() for body in bodies):
            if layer == "tendons" and not body.endswith(CENTRELINE):
                continue  # its deviations are those of its centreline
            kept = np.arange(len(layers[layer][body].vertices))
            kept = np.delete(kept, cut) if body == "skin" else kept
            errors = None if truth is None else truth.errors(rig, frame, layers[layer], body)[kept]
            for name, known in bars.items():
                bar = known[layer][body][kept]
                found.append(Compared(name, frame.name, KINDS[layer], body, bar, errors))
    return found


@dataclass(frozen=True)
class TruePose:
    """The truth of a scanned pose, and the motion that takes it to where the root bone is at rest."""

    known: Mapping[str, Any]
    home: RigidTransform

    @staticmethod
    def read(files: Sequence[Path], pose: str, home: RigidTransform) -> TruePose:
        """Of the files of all poses that have a truth."""
        return TruePose(true_pose(files, pose), home)

    def errors(self, rig: Rig, frame: Frame, shapes: Shapes, body: str) -> Array:
        """Errors (n,) in mm of a body's points.

        Of a bone how far its vertices are moved to another place, of other bodies the distances from the true
        surface or centreline.
        """
        points = shapes[body].vertices
        if body in frame.bones:
            motion = self.home @ true_motion(self.known, body)
            rest = rig.surfaces[body].vertices
            return np.asarray(np.linalg.norm(frame.bones[body](rest) - motion(rest), axis=1))
        if body.endswith(CENTRELINE):
            line = self.known["tendons"][body.removesuffix(CENTRELINE)]["centreline"]
            return curve_distance(points, self.home(np.asarray(line)))
        true = self.known["skin"] if body == "skin" else self.known["muscles"][body]
        return surface_distance(points, Surface(self.home(true["vertices"]), true["triangles"]))
