"""Simulated frames as arrays: joint angles, motions of bones, vertices of the bodies that are shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.hand import SimulatedFrame, surfaces_once

Body = tuple[str, str]  # layer and body
RIGID_LAYER = "bones"  # whose bodies follow their bone


@dataclass(frozen=True, eq=False)
class Examples:
    """One body in all frames.

    rest (n, 3) and cells (k, 3) or (k, 2); vertices (F, n, 3) in float32, mm; fields over points or cells.
    """

    rest: Array
    cells: IntArray
    vertices: Array
    fields: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Frames that a level is learned from.

    Parameters
    ----------
    names : list of str
        Names of the F frames.
    angle_names, bones : tuple of str
        Names of the angles and of the bones.
    angles : array (F, a)
        Joint angles, rad.
    motions : array (F, b, 3, 4)
        Rotation and translation in mm of each bone from neutral.
    bodies : mapping of (str, str) to Examples
        Bodies by layer and name, without the bones and without what lies inside of another body.
    """

    names: list[str]
    angle_names: tuple[str, ...]
    bones: tuple[str, ...]
    angles: Array
    motions: Array
    bodies: Mapping[Body, Examples]

    @staticmethod
    def of(frames: Sequence[SimulatedFrame], source: str = "frames") -> TrainingSet:
        """The arrays of simulated frames.

        Parameters
        ----------
        frames : sequence of SimulatedFrame
            Frames with the same bodies and joints; each is asked for once.
        source : str
            What an error names.

        Returns
        -------
        TrainingSet
            All frames.

        Raises
        ------
        InputError
            Without frames, or where frames differ in bodies, bones or angles.
        """
        described, kept, moved = [], {}, {}  # type: ignore[var-annotated]
        for number, (frame, layers) in enumerate(frames):
            described.append(frame)
            for layer, body, shape in surfaces_once(layers):
                if layer != RIGID_LAYER:
                    kept.setdefault((layer, body), shape)
                    moved.setdefault((layer, body), {})[number] = shape.vertices.astype(np.float32)
        if not described:
            raise InputError(source, "frames", "there is none", "Simulate frames first")
        first = described[0]
        for frame in described:
            _require_same(source, frame.name, "angles", frame.angles, first.angles)
            _require_same(source, frame.name, "bones", frame.bones, first.bones)
        for body, found in moved.items():
            missing = [frame.name for number, frame in enumerate(described) if number not in found]
            if missing:
                problem = f"{'/'.join(body)} is missing"
                raise InputError(source, f"frame {missing[0]}", problem, "Give frames of the same layers")
        names, bones = tuple(first.angles), tuple(first.bones)
        return TrainingSet(
            [frame.name for frame in described],
            names,
            bones,
            np.array([[frame.angles[name] for name in names] for frame in described]),
            np.array([[frame.bones[bone].matrix for bone in bones] for frame in described]),
            {
                body: Examples(
                    shape.rest,
                    shape.cells,
                    np.stack([moved[body][number] for number in range(len(described))]),
                    dict(shape.fields),
                )
                for body, shape in kept.items()
            },
        )

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.names)

    def chosen(self, which: BoolArray | IntArray) -> TrainingSet:
        """Some of the frames, by a mask (F,) or by their numbers."""
        numbers = np.arange(len(self))[which]
        bodies = {
            body: Examples(found.rest, found.cells, found.vertices[numbers], found.fields)
            for body, found in self.bodies.items()
        }
        return TrainingSet(
            [self.names[i] for i in numbers],
            self.angle_names,
            self.bones,
            self.angles[numbers],
            self.motions[numbers],
            bodies,
        )


def _require_same(source: str, frame: str, what: str, given: Iterable[str], first: Iterable[str]) -> None:
    if [*given] != [*first]:
        raise InputError(source, f"frame {frame}", f"its {what} are other ones", "Give frames of one rig")
