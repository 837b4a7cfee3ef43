"""One chunk of a scene's frames at a learned level; a frame that is unlike the learned ones is named."""

from __future__ import annotations

import logging
import sys
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import Frame, organs
from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import write_frames
from handpipe.levels import LearnedHand
from handpipe.skeleton.drivers import read_frames
from handpipe.skeleton.rig import Rig
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
    if level == "full":
        raise ValueError("a scene that is simulated is not animated")
    driven = list(read_frames(inputs.frames, rig, hand=dataset.hand, bones=scene.bones).items())
    first, shown = chunk * scene.chunk, set(organs()) & set(scene.needed)
    hand = LearnedHand.load(inputs.levels).only(lambda body: body[0] in shown)
    frames = []
    for name, angles in driven[first : first + scene.chunk]:
        frame = Frame(name, angles, rig.bone_transforms(angles))
        frames.append((frame, hand.frame(frame, level)))
        distance = hand.distance(hand.angles_of(angles))
        if distance > 1:
            said = f"frame {name}: its pose is unlike the learned ones ({distance:.1f} times the farthest)"
            log.warning("%s", said)
            print(f"handpipe: animate: {said}; the stated errors do not hold", file=sys.stderr)
    write_frames(output, frames, inputs.all())
