"""Frames of the embedded hand: inverted tets that are handed on, refusals, and jumps along a path."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.frames.mixtures import mixtures
from handpipe.core import Array, Frame, HandpipeError, IntArray, Metrics, Shapes, artifacts_of
from handpipe.core.configuration import load_dataset, load_scene
from handpipe.hand import load_layers, simulate_frame
from handpipe.skeleton.joints.angles import Angles, Limits
from handpipe.skeleton.posing import PoseValidity
from handpipe.skeleton.rig import Rig

log = logging.getLogger(__name__)

ROOT = Path(__file__).parents[2]
SUBJECT = "phantom-hand-preview"
COUNT = 60  # random poses, half of them inside the range of the scans
STEPS = 20  # of the path
STEP = np.radians(1.0)  # of each flexion, from frame to frame of the path
CURL = (0.5, 1.0)  # shares of a flexion's limit in a pose outside the scans
SIDEWAYS = 0.3  # share of the limits of other angles, at most
JUMP = 0.5  # mm of second difference along the path

Solve = Callable[[Frame], Mapping[str, Shapes]]


def measure(results: Path, count: int = COUNT, steps: int = STEPS) -> Metrics:
    """Figures of `count` random poses and of a path of `steps` steps, of the hand built in `results`."""
    base = results / SUBJECT
    rig, dataset = Rig.load(base / "rig.h5"), load_dataset(ROOT / f"config/datasets/{SUBJECT}.yaml")
    scene = load_scene(ROOT / "config/scenes/hand-preview.yaml")
    files = [base / path for path in artifacts_of(scene.needed, dataset)]
    layers = load_layers(scene.needed, dataset, files, rig.surfaces)
    scanned = {name: rig.poses[name].angles for name in dataset.examples}
    valid = PoseValidity(rig)
    outside, rejected = apart(curled(rig.limits), count // 2, lambda pose: bool(valid.check(pose).collisions))
    log.info(
        "bones collide in %d of %d poses outside the scans: passed over", rejected, rejected + len(outside)
    )
    random = [*mixtures(scanned, count - count // 2), *outside]
    way = path(mixtures(scanned, 1, seed=1)[0], rig.limits, steps)

    def frames(poses: Sequence[Angles], name: str) -> list[Frame]:
        return [Frame(f"{name} {i}", a, rig.bone_transforms(a)) for i, a in enumerate(poses)]

    def solve(frame: Frame) -> Mapping[str, Shapes]:
        return simulate_frame(frame, layers)

    tried, along = Tried(), Tried()
    for frame in frames(random, "random"):
        tried.take(frame, solve)
    for frame in frames(way, "path"):
        along.take(frame, solve)
    return figures(tried, along) | {"frames_colliding": (float(rejected), "1")}


@dataclass
class Tried:
    """What came of frames: their skins (n, 3) in order, None if refused; inverted tets that were handed on;
    frames that say that they are not settled; the least det F.
    """

    skins: list[Array | None] = field(default_factory=list)
    inverted: int = 0
    unsettled: int = 0
    least: float = np.inf

    def take(self, frame: Frame, solve: Solve) -> None:
        """Solve a frame and judge it."""
        try:
            layers = solve(frame)
        except HandpipeError as error:
            log.warning("%s: refused: %s", frame.name, error)
            self.skins.append(None)
            return
        shapes = [shape for layer in layers.values() for shape in layer.values()]
        ratios = [volume_ratios(s.rest, s.vertices, s.cells) for s in shapes if s.cells.shape[1] == 4]
        least = min((float(r.min()) for r in ratios), default=np.inf)
        inverted = sum(int((~(r > 0)).sum()) for r in ratios)
        unsettled = any(shape.figures.get("unsettled", 0.0) for shape in shapes)
        log.info(
            "%s: %d inverted tets, least det F %.3g, unsettled: %s", frame.name, inverted, least, unsettled
        )
        self.inverted += inverted
        self.unsettled += unsettled
        self.least = min(self.least, least)
        self.skins.append(
            next((layer["skin"].vertices for layer in layers.values() if "skin" in layer), None)
        )

    @property
    def refused(self) -> int:
        """Number of frames without a result."""
        return sum(skin is None for skin in self.skins)


def figures(random: Tried, along: Tried) -> Metrics:
    """Counts over all frames, and the jumps along the path."""
    second = jumps(along.skins)
    return {
        "frames": (float(len(random.skins) + len(along.skins)), "1"),
        "frames_inverted": (float(random.inverted + along.inverted), "1"),
        "frames_refused": (float(random.refused + along.refused), "1"),
        "frames_unsettled": (float(random.unsettled + along.unsettled), "1"),
        "frames_least_det": (min(random.least, along.least), "1"),
        "frames_jump_max": (float(second.max(initial=0.0)), "mm"),
        "frames_jumps": (float((second > JUMP).sum()), "1"),
    }


def jumps(skins: Sequence[Array | None]) -> Array:
    """Largest second difference (n,) in mm of each vertex along a path; a refused frame leaves a gap."""
    triples = [t for t in zip(skins, skins[1:], skins[2:], strict=False) if all(s is not None for s in t)]
    differences = [np.linalg.norm(a - 2 * b + c, axis=1) for a, b, c in triples]  # type: ignore[operator]
    return np.max(differences, axis=0) if differences else np.zeros(0)


def volume_ratios(rest: Array, vertices: Array, cells: IntArray) -> Array:
    """det F (m,) of tets (m, 4)."""
    edges = [x[cells[:, 1:]] - x[cells[:, :1]] for x in (rest, vertices)]
    return np.linalg.det(edges[1]) / np.linalg.det(edges[0])


def curled(limits: Limits, seed: int = 0) -> Iterator[dict[str, float]]:
    """Random poses in rad towards a fist: each flexion at half to all of its limit, other angles small."""
    rng = np.random.default_rng(seed)
    while True:
        share = rng.uniform(*CURL, len(limits))
        other = rng.uniform(0.0, SIDEWAYS, len(limits))
        side = rng.integers(2, size=len(limits))
        yield {
            name: float(share[i] * bounds[1] if name.endswith("flexion") else other[i] * bounds[side[i]])
            for i, (name, bounds) in enumerate(limits.items())
        }


def apart(
    poses: Iterable[dict[str, float]], count: int, collide: Callable[[Angles], bool]
) -> tuple[list[dict[str, float]], int]:
    """The first `count` poses whose bones do not collide, and the number of poses passed over.

    Fingers that bend independently of one another run through one another: no flesh fits between them.
    """
    found: list[dict[str, float]] = []
    rejected = 0
    for pose in poses:
        if collide(pose):
            rejected += 1
        else:
            found.append(pose)
        if len(found) == count:
            break
    return found, rejected


def path(start: Angles, limits: Limits, steps: int) -> list[dict[str, float]]:
    """Poses in rad, from a start on: each flexion grows by one degree a step, up to its limit."""

    def angle(name: str, value: float, step: int) -> float:
        return min(value + step * STEP, limits[name][1]) if name.endswith("flexion") else value

    return [{n: float(angle(n, v, step)) for n, v in start.items()} for step in range(steps + 1)]
