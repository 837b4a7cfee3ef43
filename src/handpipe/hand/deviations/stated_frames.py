"""Frames with the stated deviations of their bodies, and the artifact of these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import artifacts
from handpipe.hand.deviations.stated import HandDeviations
from handpipe.hand.frames import ComputedFrames
from handpipe.hand.simulation import SimulatedFrame
from handpipe.skeleton.rig import Rig

FIELD = "deviation"


def with_deviations(
    frames: Sequence[SimulatedFrame], rig: Rig, known: HandDeviations
) -> Sequence[SimulatedFrame]:
    """Frames with the bodies alone that have stated deviations, as their field `deviation` (n,) in mm.

    Parameters
    ----------
    frames : sequence of SimulatedFrame
        Frames of a scene, whose poses are given by angles.
    rig : Rig
        The rig.
    known : HandDeviations
        What is stated of the hand.

    Returns
    -------
    sequence of SimulatedFrame
        The frames, each computed when it is asked for.
    """
    return ComputedFrames(
        frames,
        lambda frame, layers: {
            layer: {
                body: replace(layers[layer][body], fields={FIELD: values}) for body, values in bodies.items()
            }
            for layer, bodies in known.of_frame(rig, frame, layers).items()
        },
    )


def write_stated(
    path: str | Path,
    frames: Sequence[SimulatedFrame],
    rig: Rig,
    known: HandDeviations,
    inputs: Sequence[str | Path] = (),
) -> None:
    """Write the deviations of frames that `with_deviations` gave, as an artifact.

    Of kind "frame_deviations": `names`; `frames/{number}/layers/{layer}/{body}` (n,) in mm of each point;
    `frames/{number}/bones/{bone}/rotation` in deg, `translation` in mm of its centroid, root mean squares.

    Parameters
    ----------
    path : str or Path
        File to write.
    frames : sequence of SimulatedFrame
        Frames with their deviations.
    rig : Rig
        The rig.
    known : HandDeviations
        What is stated of the hand.
    inputs : sequence of str or Path, optional
        Files that the artifact is computed from; it records their hashes.
    """
    data: dict[str, Any] = {"names": [], "frames": {}}
    units = {}
    for number, (frame, layers) in enumerate(frames):
        data["names"].append(frame.name)
        bones = {
            bone: {
                "rotation": float(np.degrees(np.sqrt(np.trace(c[:3, :3])))),
                "translation": float(np.sqrt(np.trace(c[3:, 3:]))),
            }
            for bone, c in known.of_bones(rig, frame).items()
        }
        stated = {
            layer: {body: shape.fields[FIELD].astype(np.float32) for body, shape in shapes.items()}
            for layer, shapes in layers.items()
        }
        data["frames"][f"{number:06d}"] = {"bones": bones, "layers": stated}
        units[f"frames/{number:06d}/layers"] = "mm"
        units |= {f"frames/{number:06d}/bones/{bone}/rotation": "deg" for bone in bones}
        units |= {f"frames/{number:06d}/bones/{bone}/translation": "mm" for bone in bones}
    data["names"] = np.array(data["names"], dtype=str)
    artifacts.write(path, data, kind="frame_deviations", units=units, inputs=inputs)
