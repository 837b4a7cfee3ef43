"""One chunk of a scene's frames with muscles that bulge and a skin of springs (Albrecht 2003)."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import ConvergenceError
from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import Failure, write_frames
from handpipe.levels.mass_spring import SpringHand
from handpipe.skeleton.rig import Rig
from handpipe.stages.driven_frames import driven_frames
from handpipe.stages.files import Files
from handpipe.tissues.fat import Skin
from handpipe.tissues.muscles import Muscle


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads: muscles, if the scene has the layer."""

    rig: Path
    frames: Path
    skin: Path
    muscles: Sequence[Path]


def animate_springs(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene, chunk: int) -> None:
    """One chunk of a scene's frames with muscles that bulge and a skin of springs (Albrecht 2003)."""
    rig = Rig.load(inputs.rig)
    hand = SpringHand.of(rig, Skin.load(inputs.skin), [Muscle.load(path) for path in inputs.muscles])
    frames, failures = [], []
    for frame in driven_frames(inputs.frames, rig, dataset, scene, chunk):
        try:
            shapes = hand.frame(frame)
        except ConvergenceError as error:
            failures.append(Failure(frame.name, "skin", str(error)))
            print(f"handpipe: animate_springs: {failures[-1]}", file=sys.stderr)
            continue
        shown = {"bones", *scene.layers}
        frames.append((frame, {layer: made for layer, made in shapes.items() if layer in shown and made}))
    write_frames(output, frames, inputs.all(), failures=failures)
