"""Frames of the embedded hand: inverted tets that are passed on, refusals, and jumps along a path.

Chunks of frames are jobs of their own (chunk.py): they run side by side, and a benchmark that was interrupted
does not solve them again.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.trust.poses import CHUNKS, COUNT, curled, passed_over, poses_of
from handpipe.core import Array, Frame, HandpipeError, IntArray, Metrics, Shapes, artifacts_of, atomic
from handpipe.core.configuration import Dataset, load_dataset, load_scene
from handpipe.hand import load_layers, simulate_frame
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.posing import PoseValidity
from handpipe.skeleton.rig import Rig

log = logging.getLogger(__name__)

ROOT = Path(__file__).parents[2]
SUBJECT = "phantom-hand-preview"
JUMP = 0.5  # mm of second difference along the path

Solve = Callable[[Frame], Mapping[str, Shapes]]


@dataclass
class Tried:
    """What came of frames: their skins (n, 3) in mm in order, None if refused; inverted tets that were passed
    on; frames that say that their contact has not settled; the least det F; seconds of each frame.
    """

    skins: list[Array | None] = field(default_factory=list)
    inverted: int = 0
    unsettled: int = 0
    least: float = np.inf
    seconds: list[float] = field(default_factory=list)

    def take(self, frame: Frame, solve: Solve) -> None:
        """Solve a frame and judge it."""
        start = time.monotonic()
        try:
            layers = solve(frame)
        except HandpipeError as error:
            log.warning("%s: refused: %s", frame.name, error)
            self.skins.append(None)
            self.seconds.append(time.monotonic() - start)
            return
        self.seconds.append(time.monotonic() - start)
        shapes = [shape for layer in layers.values() for shape in layer.values()]
        ratios = [volume_ratios(s.rest, s.vertices, s.cells) for s in shapes if s.cells.shape[1] == 4]
        least = min((float(r.min()) for r in ratios), default=np.inf)
        inverted = sum(int((~(r > 0)).sum()) for r in ratios)
        unsettled = any(shape.figures.get("unsettled", 0.0) for shape in shapes)
        log.info(
            "%s: %d inverted tets, least det F %.3g, unsettled: %s, %.0f s",
            *(frame.name, inverted, least, unsettled, self.seconds[-1]),
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

    def write(self, file: Path) -> None:
        """Write to a NumPy archive."""
        solved = {f"skin{i}": skin for i, skin in enumerate(self.skins) if skin is not None}
        counts = {"inverted": self.inverted, "unsettled": self.unsettled, "least": self.least}
        with atomic(file) as temporary, open(temporary, "wb") as stream:
            np.savez_compressed(stream, seconds=self.seconds, **counts, **solved)  # type: ignore[arg-type]

    @classmethod
    def read(cls, files: Sequence[Path]) -> Tried:
        """Join what was written of chunks, in their order."""
        together = cls()
        for file in files:
            with np.load(file) as found:
                seconds = found["seconds"].tolist()
                together.skins += [found.get(f"skin{i}") for i in range(len(seconds))]
                together.seconds += seconds
                together.inverted += int(found["inverted"])
                together.unsettled += int(found["unsettled"])
                together.least = min(together.least, float(found["least"]))
        return together


def figures(random: Tried, along: Tried) -> Metrics:
    """Counts over all frames, and the jumps along the path."""
    second = jumps(along.skins)
    seconds = [*random.seconds, *along.seconds]
    return {
        "frames": (float(len(seconds)), "1"),
        "frames_inverted": (float(random.inverted + along.inverted), "1"),
        "frames_refused": (float(random.refused + along.refused), "1"),
        "frames_unsettled": (float(random.unsettled + along.unsettled), "1"),
        "frames_least_det": (min(random.least, along.least), "1"),
        "frames_jump_max": (float(second.max(initial=0.0)), "mm"),
        "frames_jumps": (float((second > JUMP).sum()), "1"),
        "frame_seconds_mean": (float(np.mean(seconds)), "s"),
        "frame_seconds_max": (float(np.max(seconds)), "s"),
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


def measure(results: Path) -> Metrics:
    """Figures of all chunks, which `results` holds."""
    files = {chunk: results / "benchmarks" / "trust" / "frames" / f"{chunk}.npz" for chunk in CHUNKS}
    rig, _ = _hand(results)
    over = passed_over(curled(rig.limits), COUNT["outside"], _collide(rig))
    return figures(
        Tried.read([file for chunk, file in files.items() if not chunk.startswith("path")]),
        Tried.read([file for chunk, file in files.items() if chunk.startswith("path")]),
    ) | {"frames_colliding": (float(over), "1")}


def _hand(results: Path) -> tuple[Rig, Dataset]:
    return Rig.load(results / SUBJECT / "rig.h5"), load_dataset(ROOT / f"config/datasets/{SUBJECT}.yaml")


def _collide(rig: Rig) -> Callable[[Angles], bool]:
    valid = PoseValidity(rig)
    return lambda pose: bool(valid.check(pose).collisions)


def solved(chunk: str, results: Path) -> Tried:
    """What comes of the frames of a chunk, of the hand built in `results`."""
    rig, dataset = _hand(results)
    scene = load_scene(ROOT / "config/scenes/hand-preview.yaml")
    files = [results / SUBJECT / path for path in artifacts_of(scene.needed, dataset)]
    layers = load_layers(scene.needed, dataset, files, rig.surfaces)
    scanned = {name: rig.poses[name].angles for name in dataset.examples}
    tried = Tried()
    for name, angles in poses_of(chunk, scanned, rig.limits, _collide(rig)).items():
        frame = Frame(name, angles, rig.bone_transforms(angles))
        tried.take(frame, lambda frame: simulate_frame(frame, layers))
    return tried
