"""One chunk of a scene's frames, every layer that the scene needs; a failed frame is named and left out.

Finished frames of a killed job, or of one with failed frames, are beside the output and are not made again.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import Simulated, finished_frames, key_of, load_layers, write_frames
from handpipe.hand import simulate as simulate_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.driven_frames import driven_frames
from handpipe.stages.files import Files
from handpipe.tissues.muscles import MuscleLayer


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    layers: Sequence[Path]


def simulate(
    inputs: Inputs,
    output: Path,
    dataset: Dataset,
    scene: Scene,
    chunk: int,
    partial: Path,
    made_of: Mapping[str, str],
) -> None:
    """One chunk of a scene's frames, every layer that the scene needs; a failed frame is named and left out.

    partial: finished frames of a killed job, or of one with failed frames; they are not made again where
    layers and `made_of` are the same, unless each frame is to start from the one before.
    """
    rig = Rig.load(inputs.rig)
    wanted = driven_frames(inputs.frames, rig, dataset, scene, chunk)
    layers = load_layers(scene.needed, dataset, inputs.layers, rig.surfaces)
    asked: dict[str, str | Sequence[str]] = {"layers": scene.needed}
    if scene.muscle_barrier:
        layers = [x.behind_barrier() if isinstance(x, MuscleLayer) else x for x in layers]
        asked["muscle_barrier"] = "true"
    if scene.follow:
        asked["follow"] = "true"
    key = key_of([inputs.rig, *inputs.layers], {**made_of, **asked})

    def keep(found: Simulated) -> None:
        """Finished frames beside the output, but for the last frame: the output follows."""
        if len(found.frames) + len(found.failures) < len(wanted):
            write_frames(partial, found.frames, key=key)

    done = finished_frames(partial, key, wanted)
    # A chunk whose frames follow one another begins anew if it is killed: none is kept.
    found = simulate_frames(wanted, layers, done, None if scene.follow else keep, scene.follow)
    write_frames(output, found.frames, inputs.all(), failures=found.failures, key=key)
    partial.unlink(missing_ok=True)
    for failure in found.failures:
        print(f"handpipe: simulate: {failure}", file=sys.stderr)
