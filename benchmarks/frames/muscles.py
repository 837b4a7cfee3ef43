"""The muscles' layer of a built subject, pose by pose."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np

from handpipe.core import ConvergenceError, Frame, Metrics, Shapes
from handpipe.core.metrics import summary
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.posing import BoneLayer
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import Tissue
from handpipe.tissues.fat.flesh import FleshLayer
from handpipe.tissues.muscles import Muscle, MuscleLayer, SimulationOptions
from handpipe.tissues.muscles.layer import known_surfaces

SETTLED = SimulationOptions().contacts.settled  # mm


@dataclass(frozen=True)
class Result:
    """What a pose came to: renewals of contact, motion left and deepest overlap in mm (infinite where there
    is no result), seconds.
    """

    renewals: float
    motion: float
    overlap: float
    seconds: float

    @property
    def failed(self) -> bool:
        return not np.isfinite(self.motion)


def simulated(subject: Path, rig: Rig, poses: Sequence[Mapping[str, float]]) -> list[Result]:
    """Each pose (angles in rad) by the muscles in a subject's folder; prints a line a pose."""
    muscles = [Muscle.load(path) for path in sorted(subject.glob("muscles/*/strains.h5"))]
    bones, flesh = BoneLayer(rig.surfaces), FleshLayer(Tissue.load(subject / "flesh.h5"))
    layer = MuscleLayer(muscles, examples=known_surfaces(muscles))
    results = []
    for number, angles in enumerate(poses):
        frame = Frame(f"pose {number}", angles, rig.bone_transforms(angles))
        below = {"bones": bones.solve(frame, {})}
        below["flesh"] = flesh.solve(frame, below)
        results.append(_result(layer, frame, below))
        print(f"{frame.name} of {len(poses)}: {results[-1]}", flush=True)
    return results


def _result(layer: MuscleLayer, frame: Frame, below: Mapping[str, Shapes]) -> Result:
    start = time.perf_counter()
    try:
        shapes = layer.solve(frame, below)
    except ConvergenceError as error:
        print(error)
        return Result(layer.options.contacts.renewals, np.inf, np.inf, time.perf_counter() - start)
    seconds, told = time.perf_counter() - start, shapes[layer.muscles[0].name].figures
    return Result(told["contact_renewals"], told["contact_motion"], _overlap(layer, shapes), seconds)


def _overlap(layer: MuscleLayer, shapes: Shapes) -> float:
    """Depth in mm at most of a muscle's vertex that no bone holds in another muscle."""
    surfaces = {m.name: Surface(shapes[m.name].vertices, shapes[m.name].cells) for m in layer.muscles}
    distances = {name: Distance(surface) for name, surface in surfaces.items()}
    free = {m.name: np.delete(surfaces[m.name].vertices, m.firm, axis=0) for m in layer.muscles}
    return max(float(distances[b].depths(free[a]).max()) for a, b in permutations(surfaces, 2))


def figures(results: Sequence[Result]) -> Metrics:
    """Counts of poses, and what those that have a result took."""
    done = [r for r in results if not r.failed]
    found: Metrics = {
        "poses": (float(len(results)), "1"),
        "poses_failed": (float(len(results) - len(done)), "1"),
        "poses_at_rest": (float(sum(r.motion < SETTLED for r in done)), "1"),
    }
    for name, unit in (("renewals", "1"), ("motion", "mm"), ("overlap", "mm"), ("seconds", "s")):
        found |= summary(name, [getattr(r, name) for r in done], unit) if done else {}
    return found
