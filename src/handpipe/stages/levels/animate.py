"""One chunk of a scene's frames at a learned level; a frame that is unlike the learned ones is named."""

from __future__ import annotations

import logging
import sys
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import organs
from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import write_frames
from handpipe.levels import LearnedHand
from handpipe.skeleton.rig import Rig
from handpipe.stages.driven_frames import driven_frames
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    levels: Path


def animate(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene, chunk: int) -> None:
    """One chunk of a scene's frames at a learned level; a frame that is unlike the learned ones is named."""
    rig, level = Rig.load(inputs.rig), scene.level
    if level not in ("L0", "L1"):
        raise ValueError(f"a scene of level {level} is not learned")
    shown = set(organs()) & set(scene.needed)
    hand = LearnedHand.load(inputs.levels).only(lambda body: body[0] in shown)
    frames = []
    for frame in driven_frames(inputs.frames, rig, dataset, scene, chunk):
        frames.append((frame, hand.frame(frame, level)))
        distance = hand.distance(hand.angles_of(frame.angles))
        if distance > 1:
            times = f"{distance:.1f} times the farthest"
            said = f"frame {frame.name}: its pose is unlike the learned ones ({times})"
            log.warning("%s", said)
            print(f"handpipe: animate: {said}; the stated errors do not hold", file=sys.stderr)
    write_frames(output, frames, inputs.all())
