"""Frames of one job as arrays of plain NumPy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, Frame, InputError, atomic
from handpipe.hand import Failure, SimulatedFrame, surfaces_once
from handpipe.levels.training_set import RIGID_LAYER
from handpipe.skeleton.drivers import LandmarkMap
from handpipe.skeleton.rig import Rig

SPLITS = (*("train",) * 8, "validation", "test")  # of ten frames, by their numbers' last digit


@dataclass(frozen=True)
class Shard:
    """Frames of one job, and which of them failed.

    Parameters
    ----------
    wanted : sequence of Frame
        All frames of the job in their order, with angles and bones.
    first : int
        Number of the first one in the training set.
    frames : sequence of SimulatedFrame
        Those that were computed, with their bodies.
    failures : sequence of Failure
        The others.
    figures : sequence of mapping of str to float
        Figures of the computed frames.
    """

    wanted: Sequence[Frame]
    first: int
    frames: Sequence[SimulatedFrame]
    failures: Sequence[Failure]
    figures: Sequence[Mapping[str, float]]

    def arrays(self, rig: Rig, landmarks: LandmarkMap) -> dict[str, Array]:
        """The content of the file, by name.

        Parameters
        ----------
        rig : Rig
            Rig that moved the frames.
        landmarks : LandmarkMap
            Where landmarks are on it.

        Returns
        -------
        dict of str to array
            Of the V computed frames `number`, `name`, `split` (V,), `angles` (V, a) in rad, `bones`
            (V, b, 3, 4) with rotation and translation in mm of each bone from neutral, `landmarks`
            (V, 21, 3) in mm, vertices `{layer}/{body}` (V, n, 3) in mm and float32, and `figures/{name}`
            (V,), NaN in frames without the figure; of the failed ones `invalid/number`, `invalid/name`,
            `invalid/angles`, `invalid/layer` and `invalid/reason`.

        Raises
        ------
        InputError
            If a frame is neither computed nor failed.
        """
        numbers = {frame.name: self.first + i for i, frame in enumerate(self.wanted)}
        failed = {failure.frame: failure for failure in self.failures}
        missing = numbers.keys() - failed.keys() - {frame.name for frame, _ in self.frames}
        if missing:
            remedy = "Delete the scene's frames and run the workflow again"
            raise InputError("shard", min(missing), "is neither computed nor failed", remedy)
        lost = [frame for frame in self.wanted if frame.name in failed]
        good = [frame for frame, _ in self.frames]
        number = np.array([numbers[frame.name] for frame in good], np.int64)
        return {
            "number": number,
            "name": _texts([frame.name for frame in good]),
            "split": np.array(SPLITS)[number % len(SPLITS)],
            "angles": _angles(good, rig),
            "bones": np.array(
                [[frame.bones[bone].matrix for bone in rig.bones] for frame in good], float
            ).reshape(-1, len(rig.bones), 3, 4),
            "landmarks": np.array([landmarks.points(frame.bones) for frame in good], float).reshape(
                -1, 21, 3
            ),
            **self._vertices(),
            **self._figures(),
            "invalid/number": np.array([numbers[frame.name] for frame in lost], np.int64),
            "invalid/name": _texts([frame.name for frame in lost]),
            "invalid/angles": _angles(lost, rig),
            "invalid/layer": _texts([failed[frame.name].layer for frame in lost]),
            "invalid/reason": _texts([failed[frame.name].reason for frame in lost]),
        }

    def write(self, path: str | Path, rig: Rig, landmarks: LandmarkMap) -> None:
        """Write `arrays` as one archive of NumPy, the same bytes for the same frames."""
        with atomic(path) as temporary:
            np.savez_compressed(temporary, **self.arrays(rig, landmarks))  # type: ignore[arg-type]

    def _vertices(self) -> dict[str, Array]:
        found: dict[str, list[Array]] = {}
        for _, layers in self.frames:
            for layer, body, shape in surfaces_once(layers):
                if layer != RIGID_LAYER:
                    found.setdefault(f"{layer}/{body}", []).append(shape.vertices.astype(np.float32))
        return {body: np.stack(vertices) for body, vertices in found.items()}

    def _figures(self) -> dict[str, Array]:
        names = dict.fromkeys(name for row in self.figures for name in row)
        return {
            f"figures/{name}": np.array([row.get(name, np.nan) for row in self.figures], float)
            for name in names
        }


def _angles(frames: Sequence[Frame], rig: Rig) -> Array:
    """Angles (f, a) in rad in the order of the rig's names."""
    rows = [[frame.angles[name] for name in rig.angle_names] for frame in frames]
    return np.array(rows, float).reshape(-1, len(rig.angle_names))


def _texts(texts: Sequence[str]) -> Array:
    return np.array(texts, dtype=str)
