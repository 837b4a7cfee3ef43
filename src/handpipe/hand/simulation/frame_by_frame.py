"""Layers solved inside out, frame by frame (Zheng 2022 §3, Fig. 5).

Frames do not depend on one another, unless each is to start from the one before.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from handpipe.core import (
    LAYERS,
    ConvergenceError,
    FollowingLayer,
    Frame,
    HandpipeError,
    InputError,
    Layer,
    Shapes,
    SimulatedFrame,
    organs,
)

log = logging.getLogger(__name__)
RIGID = 1e-6  # by which R^T R may differ from the identity


@dataclass(frozen=True)
class Failure:
    """A frame that could not be simulated, the layer that failed, and why.

    Parameters
    ----------
    frame : str
        Name of the frame.
    layer : str
        Name of the layer.
    reason : str
        Text of the error.
    """

    frame: str
    layer: str
    reason: str

    def __str__(self) -> str:
        """One line: the frame, the layer and the reason."""
        return f"frame {self.frame}: {self.layer}: {self.reason}"


Attempt = SimulatedFrame | Failure
Ahead = Callable[[Sequence[Frame], SimulatedFrame | None], Iterator[Attempt]]


@dataclass(frozen=True)
class Simulated:
    """Finished frames and failures, each in the order of the frames.

    Parameters
    ----------
    frames : list of SimulatedFrame
        Finished frames with their shapes by layer and body.
    failures : list of Failure
        Failed frames.
    aids : dict of str to Shapes
        Of the last finished frame, the layers that are no organs: a frame that follows it needs them.
    """

    frames: list[SimulatedFrame] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    aids: dict[str, Shapes] = field(default_factory=dict)

    def add(self, result: Attempt) -> None:
        """Add a frame, whose aids take the place of those of the frame before, or a failure."""
        if isinstance(result, Failure):
            self.failures.append(result)
            return
        frame, shapes = result
        self.frames.append((frame, _organs(shapes)))
        self.aids.clear()
        self.aids.update({name: shapes[name] for name in shapes if name not in organs()})


def simulate_frame(
    frame: Frame, layers: Sequence[Layer], known: Mapping[str, Shapes] | None = None
) -> dict[str, Shapes]:
    """Shapes of organs in one frame, each layer computed from those below it.

    Parameters
    ----------
    frame : Frame
        Pose to be simulated.
    layers : sequence of Layer
        Layers, inside out.
    known : mapping of str to Shapes, optional
        Shapes of layers that are simulated already, by layer.

    Returns
    -------
    mapping of str to Shapes
        Shapes by layer and body, without layers that are no organs.

    Raises
    ------
    ConvergenceError
        From the layer that finds no equilibrium.
    InputError
        For a frame whose angles are not finite, or whose bones' transforms are no rigid motions.

    References
    ----------
    Zheng 2022 §3, Fig. 5.
    """
    _require_rigid(frame)
    shapes: dict[str, Shapes] = dict(known or {})
    for layer in layers:
        _solve(frame, layer, shapes)
    return _organs(shapes)


def simulate(
    frames: Iterable[Frame],
    layers: Sequence[Layer],
    done: Mapping[str, SimulatedFrame] | None = None,
    keep: Callable[[Simulated], None] | None = None,
    follow: bool = False,
    before: SimulatedFrame | None = None,
    ahead: Ahead | None = None,
) -> Simulated:
    """Simulate all frames; failed frames are absent from the result and named in its failures.

    Parameters
    ----------
    frames : iterable of Frame
        Poses to be simulated.
    layers : sequence of Layer
        Layers, inside out.
    done : mapping of str to SimulatedFrame, optional
        Frames by name that an earlier run has finished.
    keep : callable, optional
        Called after each frame with the result so far, so that a killed run can be resumed.
    follow : bool
        Start each frame from the last one that was simulated, where a layer can, and from its own start where
        that fails. Then a frame depends on those before it: `done` counts up to the first frame that is not
        in it. The layers under the fat follow the last frame in which they were simulated.
    before : SimulatedFrame, optional
        The frame from which the first one starts, if they follow one another, with its aids.
    ahead : callable, optional
        From frames, and the one before them, to attempts of the layers under `layers`, as `simulated_ahead`
        gives them. Without it `layers` are all layers.

    Returns
    -------
    Simulated
        Finished frames and failures.
    """
    frames, found = list(frames), Simulated()
    finished: Mapping[str, SimulatedFrame] = done or {}
    if follow:
        first = takewhile(lambda frame: frame.name in finished, frames)
        finished = {frame.name: finished[frame.name] for frame in first}
        before = [before, *finished.values()][-1]
    wanted = [frame for frame in frames if frame.name not in finished]
    inner, outer = inner_and_outer(layers)
    below = ahead(wanted, before) if ahead else attempts(wanted, inner, follow, before)
    results = attempts(wanted, outer, follow, before, below)
    start = time.perf_counter()
    for count, frame in enumerate(frames, start=1):
        found.add(finished[frame.name] if frame.name in finished else next(results))
        if keep is not None:
            keep(found)
        elapsed = time.perf_counter() - start
        log.info("%d of %d frames, %.0f s left", count, len(frames), elapsed / count * (len(frames) - count))
    return found


def inner_and_outer(layers: Iterable[Layer]) -> tuple[list[Layer], list[Layer]]:
    """Layers under the fat, and the fat or the skin, which they do not depend on.

    Parameters
    ----------
    layers : iterable of Layer
        Layers, inside out.

    Returns
    -------
    inner, outer : list of Layer
        The two parts.
    """
    layers = list(layers)
    outer = [layer for layer in layers if layer.name in LAYERS and LAYERS[layer.name].role == "outer"]
    return [layer for layer in layers if layer not in outer], outer


def attempts(
    frames: Iterable[Frame],
    layers: Sequence[Layer],
    follow: bool = False,
    before: SimulatedFrame | None = None,
    below: Iterator[Attempt] | None = None,
) -> Iterator[Attempt]:
    """Frames one after the other, each simulated when it is asked for.

    Parameters
    ----------
    frames : iterable of Frame
        Poses to be simulated.
    layers : sequence of Layer
        Layers, inside out.
    follow : bool
        Start each frame from the last one that these layers were simulated in.
    before : SimulatedFrame, optional
        The frame from which the first one starts, if they follow one another.
    below : iterator of SimulatedFrame or Failure, optional
        The same frames with the layers under these.

    Yields
    ------
    SimulatedFrame or Failure
        A frame with all layers and those below, or why there is none.
    """
    before = _with_aids(before, layers) if follow else None
    for frame in frames:
        under = next(below) if below is not None else (frame, {})
        result = under if isinstance(under, Failure) else _attempt(frame, layers, before, under[1])
        if follow and not isinstance(result, Failure):
            before = result
        yield result


def _attempt(
    frame: Frame, layers: Sequence[Layer], before: SimulatedFrame | None, under: Mapping[str, Shapes]
) -> Attempt:
    """The simulated frame, or why there is none; the traceback of an unexpected error is in the log."""
    shapes = dict(under)
    for layer in layers:
        try:
            if not shapes:  # the first layer is to name a frame that is no posture
                _require_rigid(frame)
            _solve(frame, layer, shapes, before)
        except HandpipeError as error:
            failure = Failure(frame.name, layer.name, str(error))
            log.error("%s", failure)
            return failure
        except Exception as error:
            failure = Failure(frame.name, layer.name, f"unexpected {type(error).__name__}: {error}")
            log.exception("%s", failure)
            return failure
    return frame, shapes


def _solve(
    frame: Frame, layer: Layer, shapes: dict[str, Shapes], before: SimulatedFrame | None = None
) -> None:
    """Add a layer's shapes to those of the layers below it, unless they are known."""
    if layer.name in shapes:
        return
    start = time.perf_counter()
    below = {name: shapes[name] for name in layer.needs if name in shapes}
    shapes[layer.name] = _after(before, layer, frame, below) or layer.solve(frame, below)
    log.info("frame %s: %s in %.1f s", frame.name, layer.name, time.perf_counter() - start)


def _after(
    before: SimulatedFrame | None, layer: Layer, frame: Frame, below: Mapping[str, Shapes]
) -> Shapes | None:
    """A layer's shapes in a frame, from those in the frame before; None where there is no way from these."""
    if before is None or not isinstance(layer, FollowingLayer):
        return None
    try:
        return layer.solve_after(before, frame, below)
    except ConvergenceError as error:
        log.info("frame %s: %s; again from its own start", frame.name, error)
        return None


def _with_aids(before: SimulatedFrame | None, layers: Sequence[Layer]) -> SimulatedFrame | None:
    """A frame with the layers that it lacks, as a scanned pose does; None where one has no equilibrium."""
    if before is None:
        return None
    frame, shapes = before[0], dict(before[1])
    try:
        for layer in layers:
            _solve(frame, layer, shapes)
    except ConvergenceError as error:
        log.info("frame %s: %s; the next frame starts from its own initial guess", frame.name, error)
        return None
    return frame, shapes


def _require_rigid(frame: Frame) -> None:
    """Raise `InputError` for an angle that is not finite, or a bone whose transform is no rigid motion."""
    source, remedy = f"frame {frame.name}", "Give finite angles, and transforms of Rig.bone_transforms"
    for name, angle in frame.angles.items():
        if not math.isfinite(angle):
            raise InputError(source, name, "is not a finite number", remedy)
    for name, bone in frame.bones.items():
        if not (np.isfinite(bone.rotation).all() and np.isfinite(bone.translation).all()):
            raise InputError(source, f"bone {name}", "its transform is not finite", remedy)
        stretch = np.abs(bone.rotation.T @ bone.rotation - np.eye(3)).max()
        if stretch > RIGID or np.linalg.det(bone.rotation) < 0:
            raise InputError(source, f"bone {name}", "its matrix is not a rotation", remedy)


def _organs(shapes: Mapping[str, Shapes]) -> dict[str, Shapes]:
    shown = organs()
    return {name: found for name, found in shapes.items() if name in shown}
