"""The artifact of simulated frames: every layer's shapes; rest shapes and cells are stored once."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import h5py
import numpy as np

from handpipe.core import Frame, InputError, RigidTransform, Shape, Shapes, artifacts
from handpipe.hand.simulation import Failure, SimulatedFrame

LayerShapes = Mapping[str, Shapes]  # by the layer's name

KIND = "frames"
# Units of figures; all other figures are dimensionless.
UNITS = {
    "contact_motion": "mm",
    "skin_overlap": "mm",
    "skin_gap": "mm",
    "mean_gap": "mm",
    "inner_overlap": "mm",
    "bones_outside": "mm",
    "level_bound": "mm",
    "spring_residual": "mm",
    "body_penetration": "mm",
    "residual": "mN",
}


def figure_units(figures: Iterable[str], group: str = "figures") -> dict[str, str]:
    """Units of the figures of a group of an artifact.

    Parameters
    ----------
    figures : iterable of str
        Names of the figures.
    group : str
        Path of their group in the artifact.

    Returns
    -------
    mapping of str to str
        Unit by `{group}/{figure}`, without the dimensionless figures.
    """
    return {f"{group}/{name}": UNITS[name] for name in figures if name in UNITS}


def write_frames(
    path: str | Path,
    frames: Sequence[SimulatedFrame],
    inputs: Sequence[str | Path] = (),
    *,
    failures: Sequence[Failure] = (),
    aids: LayerShapes | None = None,
    key: str = "",
) -> None:
    """Write simulated frames, and which ones failed.

    `bodies/{layer}/{body}/{rest,cells}` holds what all frames share; `frames/{number}/…` the joint angles,
    the bones' transforms, and `layers/{layer}/{body}/{vertices,fields/…,figures/…}`, numbered in the order of
    `names`, since names may hold any character; `failures/{frame,layer,reason}` a row for each failed frame;
    `aids/{layer}/{body}/{rest,cells,vertices,…}` what a frame that follows the last one needs of it besides.

    Parameters
    ----------
    path : path
        File to be written.
    frames : sequence of SimulatedFrame
        Finished frames, each with a name of its own.
    inputs : sequence of path
        Files of which the frames were made; the artifact holds their hashes.
    failures : sequence of Failure
        Failed frames.
    aids : mapping of str to Shapes, optional
        Of the last frame, the layers that are no organs, by name.
    key : str
        Digest of inputs and code, see `key_of`; `finished_frames` compares it.

    Raises
    ------
    ValueError
        Where a body's rest shape or cells differ between frames, or two frames have one name.
    """
    names = [frame.name for frame, _ in frames]
    if len(set(names)) != len(names):
        raise ValueError(f"frames need different names, not {names}")
    bodies: dict[str, dict[str, Any]] = {}
    for _, layers in frames:
        for layer, shapes in layers.items():
            for body, shape in shapes.items():
                _remember(bodies.setdefault(layer, {}), body, shape)
    data = {
        "names": np.array(names, dtype=str),
        "bodies": bodies,
        "frames": {_number(i): _frame_data(*frame) for i, frame in enumerate(frames)},
        "failures": {
            part: np.array([getattr(failure, part) for failure in failures], dtype=str)
            for part in ("frame", "layer", "reason")
        },
        "aids": {
            layer: {
                body: {"rest": shape.rest, "cells": shape.cells, **_shape_data(shape)}
                for body, shape in shapes.items()
            }
            for layer, shapes in (aids or {}).items()
        },
    }
    artifacts.write(path, data, kind=KIND, units=_units(data), inputs=inputs, attributes={"key": key})


def read_frames(path: str | Path) -> list[tuple[Frame, dict[str, Shapes]]]:
    """Read the frames that `write_frames` wrote, in its order.

    Parameters
    ----------
    path : path
        File of `write_frames`.

    Returns
    -------
    list of (Frame, dict of str to Shapes)
        Frames, each with its shapes by layer and body.

    Raises
    ------
    InputError
        For another file.
    """
    return read_simulated(path)[0]


def read_simulated(path: str | Path) -> tuple[list[tuple[Frame, dict[str, Shapes]]], list[Failure]]:
    """Read frames and failures, in the order of `write_frames`.

    Parameters
    ----------
    path : path
        File of `write_frames`.

    Returns
    -------
    frames : list of (Frame, dict of str to Shapes)
        Frames, each with its shapes by layer and body.
    failures : list of Failure
        Failed frames.

    Raises
    ------
    InputError
        For another file.
    """
    data = artifacts.read(path, KIND)
    failed = data["failures"]
    rows = zip(failed["frame"], failed["layer"], failed["reason"], strict=True)
    return _frames(data), [Failure(*map(str, row)) for row in rows]


def frames_to_follow(path: str | Path) -> list[SimulatedFrame]:
    """Read the frames that `write_frames` wrote, the last one with its aids.

    Parameters
    ----------
    path : path
        File of `write_frames`.

    Returns
    -------
    list of SimulatedFrame
        Frames in the order of `write_frames`.

    Raises
    ------
    InputError
        For another file, or one of frames that were written without aids.
    """
    data = artifacts.read(path, KIND)
    if "aids" not in data:
        problem = "are missing: an earlier version wrote the file"
        raise InputError(path, "aids", problem, "Delete the file and run the workflow again")
    frames = _frames(data)
    if frames:
        frames[-1][1].update(_layers(data["aids"], data["aids"]))
    return [*frames]


def _frames(data: Mapping[str, Any]) -> list[tuple[Frame, dict[str, Shapes]]]:
    return [
        _frame(str(name), data["frames"][_number(i)], data["bodies"]) for i, name in enumerate(data["names"])
    ]


class MadeFrames(Sequence[SimulatedFrame]):
    """Frames that are made when they are asked for: a long scene does not fit into memory."""

    @abstractmethod
    def frame(self, number: int) -> SimulatedFrame:
        """The frame of a number from 0; `IndexError` where there is none."""

    @overload
    def __getitem__(self, index: int) -> SimulatedFrame: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[SimulatedFrame]: ...
    def __getitem__(self, index: int | slice) -> SimulatedFrame | Sequence[SimulatedFrame]:
        """A frame by its number, or a list of several."""
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        return self.frame(index)


@dataclass(frozen=True)
class ComputedFrames(MadeFrames):
    """Frames with other shapes, computed of theirs.

    Parameters
    ----------
    frames : sequence of SimulatedFrame
        Frames as they are.
    shapes : function of (Frame, mapping of str to Shapes)
        Their other shapes by layer.
    """

    frames: Sequence[SimulatedFrame]
    shapes: Callable[[Frame, LayerShapes], dict[str, Shapes]]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    def frame(self, number: int) -> SimulatedFrame:
        """The frame of a number with its other shapes."""
        frame, shapes = self.frames[number]
        return frame, self.shapes(frame, shapes)


class StoredFrames(MadeFrames):
    """The frames of files, in their order, of which one file at a time is in memory.

    Parameters
    ----------
    paths : iterable of path
        Files of `write_frames`.

    Raises
    ------
    InputError
        For another file.
    """

    def __init__(self, paths: Iterable[str | Path]) -> None:
        self.names: list[str] = []
        self._places: list[tuple[Path, int]] = []
        self._last: tuple[Path, list[tuple[Frame, dict[str, Shapes]]]] | None = None
        for path in map(Path, paths):
            [names] = _texts(path, "names")
            self.names += names
            self._places += [(path, number) for number in range(len(names))]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._places)

    def angles(self) -> list[dict[str, float]]:
        """Joint angles in rad of each frame by name; no shape is read."""
        found: dict[Path, list[dict[str, float]]] = {}
        for path in dict.fromkeys(path for path, _ in self._places):
            with h5py.File(path, "r") as file:
                every = [file["frames"][number]["angles"] for number in sorted(file["frames"])]
                found[path] = [{name: float(group[name][()]) for name in group} for group in every]
        return [found[path][number] for path, number in self._places]

    def frame(self, number: int) -> SimulatedFrame:
        """The frame of a number; its whole file is read unless it was the last one."""
        path, place = self._places[number]
        if self._last is None or self._last[0] != path:
            self._last = None  # before the next file is read: one at a time
            self._last = path, read_frames(path)
        return self._last[1][place]


def frame_angles(frames: Sequence[SimulatedFrame]) -> list[dict[str, float]]:
    """Joint angles in rad of frames, by angle name; of stored ones no shape is read.

    Parameters
    ----------
    frames : sequence of SimulatedFrame
        Frames.

    Returns
    -------
    list of dict of str to float
        Angles of each frame.
    """
    if isinstance(frames, StoredFrames):
        return frames.angles()
    return [dict(frame.angles) for frame, _ in frames]


def failures_in(path: str | Path) -> list[Failure]:
    """Read the failed frames alone.

    Parameters
    ----------
    path : path
        File of `write_frames`.

    Returns
    -------
    list of Failure
        Failed frames.

    Raises
    ------
    InputError
        For a file that cannot be read.
    """
    rows = zip(*_texts(path, *(f"failures/{part}" for part in ("frame", "layer", "reason"))), strict=True)
    return [Failure(*row) for row in rows]


def _texts(path: str | Path, *names: str) -> list[list[str]]:
    """Texts of a file of frames, without its shapes."""
    try:
        with h5py.File(path, "r") as file:
            return [[str(text) for text in file[name].asstr()[()]] for name in names]
    except (OSError, KeyError) as error:
        remedy = "Delete the file and run the workflow again"
        raise InputError(path, "content", f"cannot be read as frames ({error})", remedy) from error


def finished_frames(path: str | Path, key: str, wanted: Iterable[Frame]) -> dict[str, SimulatedFrame]:
    """Frames that an earlier run has finished.

    Parameters
    ----------
    path : path
        File of the earlier run. One that cannot be read has no frames: they are simulated again.
    key : str
        Digest of inputs and code, see `key_of`; a file of another key has no frames.
    wanted : iterable of Frame
        Frames to be simulated. A frame of the same name in another pose does not count.

    Returns
    -------
    mapping of str to SimulatedFrame
        Finished frames by name, the last one of the file with its aids.
    """
    try:
        if artifacts.read_attributes(path).get("key") != key:
            return {}
        found = {frame.name: (frame, layers) for frame, layers in frames_to_follow(path)}
    except (OSError, InputError):
        return {}
    return {f.name: found[f.name] for f in wanted if f.name in found and _same(f, found[f.name][0])}


def _same(a: Frame, b: Frame) -> bool:
    """Whether two frames are one pose, their bones included."""
    return (
        dict(a.angles) == dict(b.angles)
        and a.bones.keys() == b.bones.keys()
        and all(
            np.array_equal(a.bones[n].rotation, b.bones[n].rotation)
            and np.array_equal(a.bones[n].translation, b.bones[n].translation)
            for n in a.bones
        )
    )


def _number(index: int) -> str:
    return f"{index:06d}"


def _remember(layer: dict[str, Any], body: str, shape: Shape) -> None:
    known = layer.setdefault(body, {"rest": shape.rest, "cells": shape.cells})
    if not (np.array_equal(known["rest"], shape.rest) and np.array_equal(known["cells"], shape.cells)):
        raise ValueError(f"{body}: its rest shape or cells differ between frames")


def _frame_data(frame: Frame, layers: LayerShapes) -> dict[str, Any]:
    return {
        "angles": dict(frame.angles),
        "bones": {
            name: {"rotation": t.rotation, "translation": t.translation} for name, t in frame.bones.items()
        },
        "layers": {
            layer: {body: _shape_data(shape) for body, shape in shapes.items()}
            for layer, shapes in layers.items()
        },
    }


def _shape_data(shape: Shape) -> dict[str, Any]:
    return {
        "vertices": np.asarray(shape.vertices, np.float64),
        "fields": shape.fields,
        "figures": shape.figures,
    }


def _units(data: Mapping[str, Any]) -> dict[str, str]:
    units = {
        f"bodies/{layer}/{body}/rest": "mm" for layer, shapes in data["bodies"].items() for body in shapes
    }
    for layer, shapes in data["aids"].items():
        for body, shape in shapes.items():
            base = f"aids/{layer}/{body}"
            units |= {f"{base}/rest": "mm", f"{base}/vertices": "mm"}
            units |= figure_units(shape["figures"], f"{base}/figures")
    for name, frame in data["frames"].items():
        units[f"frames/{name}/angles"] = "rad"
        units |= {f"frames/{name}/bones/{bone}/translation": "mm" for bone in frame["bones"]}
        for layer, shapes in frame["layers"].items():
            base = f"frames/{name}/layers/{layer}"
            units |= {f"{base}/{body}/vertices": "mm" for body in shapes}
            for body, shape in shapes.items():
                units |= figure_units(shape["figures"], f"{base}/{body}/figures")
    return units


def _frame(name: str, data: Mapping[str, Any], bodies: Mapping[str, Any]) -> tuple[Frame, dict[str, Shapes]]:
    angles = {angle: float(value) for angle, value in data["angles"].items()}
    bones = {b: RigidTransform(t["rotation"], t["translation"]) for b, t in data["bones"].items()}
    return Frame(name, angles, bones), _layers(bodies, data["layers"])


def _layers(bodies: Mapping[str, Any], moving: Mapping[str, Any]) -> dict[str, Shapes]:
    """Shapes by layer and body from what all frames share and what is one frame's own."""
    return {
        layer: {body: _shape(bodies[layer][body], own) for body, own in shapes.items()}
        for layer, shapes in moving.items()
    }


def _shape(shared: Mapping[str, Any], own: Mapping[str, Any]) -> Shape:
    figures = {name: float(value) for name, value in own.get("figures", {}).items()}
    return Shape(shared["rest"], own["vertices"], shared["cells"], dict(own["fields"]), figures)
