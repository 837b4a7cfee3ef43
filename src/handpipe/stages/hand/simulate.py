"""One chunk of a scene's frames, every layer that the scene needs; a failed frame is named and left out.

Finished frames of a killed job, or of one with failed frames, are beside the output and are not made again.
They are written now and then: a file of twenty frames takes as long as a frame.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from handpipe.core import Layer
from handpipe.core.configuration import Dataset, Scene
from handpipe.fem.potentials import Viscous
from handpipe.hand import (
    Simulated,
    finished_frames,
    frames_to_follow,
    key_of,
    load_layers,
    simulated_ahead,
    write_frames,
)
from handpipe.hand import simulate as simulate_frames
from handpipe.skeleton.motion import RATE
from handpipe.skeleton.rig import Rig
from handpipe.stages.driven_frames import driven_frames
from handpipe.stages.files import Files
from handpipe.tissues.muscles import MuscleLayer

INNER, OUTER = ("inner", "aid"), ("outer",)  # roles of layers under the fat, and of the fat or the skin
WAIT = 10.0  # times as long as the last writing of finished frames took, at least, until the next one


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    layers: Sequence[Path]
    before: Path | None = None


@dataclass(frozen=True)
class Chunk:
    """Which frames a job makes, and how.

    Parameters
    ----------
    number : int
        Number of the range of frames in the scene.
    partial : Path
        Finished frames of a killed job, or of one with failed frames. They are not made again where layers
        and `made_of` are the same. Where frames follow one another, those after a missing one are.
    made_of : mapping of str to str
        The digest of the code and the like.
    threads : int
        With two, the layers under the fat are simulated in a process of their own, a frame ahead.
    """

    number: int
    partial: Path
    made_of: Mapping[str, str]
    threads: int = 1


def simulate(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene, chunk: Chunk) -> None:
    """One chunk of a scene's frames, with every layer that the scene needs; failed frames are left out."""
    rig = Rig.load(inputs.rig)
    wanted = driven_frames(inputs.frames, rig, dataset, scene, chunk.number)
    asked: dict[str, str | Sequence[str]] = {"layers": scene.needed}
    if scene.muscle_barrier:
        asked["muscle_barrier"] = "true"
    if scene.follow:
        asked["follow"] = "true"
    if scene.viscosity:
        asked["viscosity"] = str(scene.viscosity)
    made_from = [path for path in (inputs.rig, *inputs.layers, inputs.before) if path is not None]
    key = key_of(made_from, {**chunk.made_of, **asked})
    kept = _FinishedFrames(chunk.partial, key, len(wanted))
    done = finished_frames(chunk.partial, key, wanted)
    earlier = [] if inputs.before is None else frames_to_follow(inputs.before)
    before = earlier[-1] if earlier else None
    ahead = None
    if chunk.threads > 1 and scene.follow:
        ahead = partial(simulated_ahead, partial(_layers_of, inputs, dataset, scene, INNER))
    layers = _layers_of(inputs, dataset, scene, OUTER if ahead else None, rig)
    found = simulate_frames(wanted, layers, done, kept.keep, scene.follow, before, ahead)
    write_frames(output, found.frames, inputs.all(), failures=found.failures, aids=found.aids, key=key)
    chunk.partial.unlink(missing_ok=True)
    for failure in found.failures:
        print(f"handpipe: simulate: {failure}", file=sys.stderr)


def _layers_of(
    inputs: Inputs, dataset: Dataset, scene: Scene, roles: Sequence[str] | None, rig: Rig | None = None
) -> list[Layer]:
    """The layers of some or all roles that a scene needs, as it asks for them; a rig not given is loaded."""
    bones = (rig or Rig.load(inputs.rig)).surfaces
    layers = load_layers(scene.needed, dataset, inputs.layers, bones, roles)
    if scene.muscle_barrier:
        layers = [x.behind_barrier() if isinstance(x, MuscleLayer) else x for x in layers]
    if scene.viscosity:
        layers = [x.viscous(scene.viscosity * RATE) if isinstance(x, Viscous) else x for x in layers]
    return layers


@dataclass
class _FinishedFrames:
    """The file of finished frames of a job of `count` frames, and when to write it again."""

    path: Path
    key: str
    count: int
    due: float = 0.0

    def keep(self, found: Simulated) -> None:
        """Write the frames if it is time, but for the last frame: the output follows."""
        start = time.perf_counter()
        if start < self.due or len(found.frames) + len(found.failures) == self.count:
            return
        write_frames(self.path, found.frames, aids=found.aids, key=self.key)
        end = time.perf_counter()
        self.due = end + WAIT * (end - start)
