"""How far the skin and the muscles move from frame to frame, beside the joints and beside the bones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, Frame, IntArray, Metrics, Shapes
from handpipe.mesh.surfaces import Surface

MOVING = ("muscles", "fat", "skin")  # layers whose surfaces are followed
LEAST = 0.5  # deg; less joint motion counts as so much: what solvers leave open is not divided by nearly zero
POP = 1.0  # mm a degree that no bone explains

Step = dict[str, str | float]


@dataclass(frozen=True)
class _Neighbours:
    """The two bones (n, 2) that are nearest to each vertex of a body at rest, by number."""

    bones: IntArray
    rest: Array


class Continuity:
    """Steps from frame to frame of a scene, compared with the motion of joints and bones.

    Parameters
    ----------
    bones : mapping of str to Surface
        Neutral surfaces of the bones in mm.
    """

    def __init__(self, bones: Mapping[str, Surface]) -> None:
        self._names = [*bones]
        self._trees = [cKDTree(bones[name].vertices) for name in self._names]
        self._neighbours: dict[str, _Neighbours] = {}
        self._before: tuple[Frame, dict[str, Array]] | None = None

    def cut(self) -> None:
        """Forget the last frame: the next one follows a frame that is missing."""
        self._before = None

    def step(self, frame: Frame, layers: Mapping[str, Shapes]) -> Step:
        """The step from the last frame to this one.

        Parameters
        ----------
        frame : Frame
            Frame with angles in rad and transforms of bones.
        layers : mapping of str to Shapes
            Its shapes by layer and body.

        Returns
        -------
        dict of str to str or float
            `joint_motion`, the largest change of an angle in deg; `move`, the largest move of a vertex of
            skin or muscles in mm, and `continuity`, its share a degree; `unexplained`, the largest distance
            in mm of a vertex from where the two bones nearest to it would carry it, or any blend of them,
            `pop`, its share a degree, and `pop_body`. Empty for a first frame, and without skin and muscles.
        """
        bodies = dict(_surfaces(layers))
        now = {name: vertices for name, (_, vertices) in bodies.items()}
        before, self._before = self._before, (frame, now)
        if before is None or not now:
            return {}
        last, shapes = before
        turned = [abs(frame.angles[n] - last.angles[n]) for n in frame.angles if n in last.angles]
        motion = float(np.degrees(max(turned, default=0.0)))
        moves = {name: _longest(now[name] - shapes[name]) for name in now if name in shapes}
        beyond = {
            name: float(self._unexplained(name, bodies[name][0], shapes[name], now[name], last, frame).max())
            for name in moves
        }
        worst, move = max(beyond, key=lambda n: beyond[n]), max(moves.values())
        return {
            "joint_motion": motion,
            "move": move,
            "continuity": move / max(motion, LEAST),
            "unexplained": beyond[worst],
            "pop": beyond[worst] / max(motion, LEAST),
            "pop_body": worst,
        }

    def _unexplained(
        self, name: str, rest: Array, before: Array, now: Array, last: Frame, frame: Frame
    ) -> Array:
        """Distance (n,) in mm of each vertex from the segment between its places by its two nearest bones."""
        near = self._nearest(name, rest)
        steps = [frame.bones[b] @ last.bones[b].inverse() for b in self._names]
        rotations = np.array([t.rotation for t in steps])
        shifts = np.array([t.translation for t in steps])
        first, second = (
            np.einsum("nij,nj->ni", rotations[near[:, k]], before) + shifts[near[:, k]] for k in (0, 1)
        )
        across = second - first
        share = np.einsum("ni,ni->n", now - first, across)
        share /= np.maximum(np.einsum("ni,ni->n", across, across), 1e-12)
        distances: Array = np.linalg.norm(now - first - np.clip(share, 0, 1)[:, None] * across, axis=1)
        return distances

    def _nearest(self, name: str, rest: Array) -> IntArray:
        known = self._neighbours.get(name)
        if known is None or not np.array_equal(known.rest, rest):
            distances = np.column_stack([tree.query(rest)[0] for tree in self._trees])
            order = np.argsort(distances, axis=1, kind="stable")
            pair = order[:, [0, min(1, order.shape[1] - 1)]]
            known = self._neighbours[name] = _Neighbours(pair, rest)
        return known.bones


def _surfaces(layers: Mapping[str, Shapes]) -> Iterator[tuple[str, tuple[Array, Array]]]:
    """Rest and posed vertices (n, 3) of every surface of skin and muscles, by layer and body."""
    for layer in MOVING:
        for body, shape in layers.get(layer, {}).items():
            if shape.cells.shape[1] == 3 and len(shape.vertices):
                yield f"{layer} {body}", (shape.rest, np.asarray(shape.vertices))


def _longest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())


def continuity_metrics(steps: Iterable[Step]) -> Metrics:
    """Figures of all steps of a scene.

    Parameters
    ----------
    steps : iterable of Step
        Steps of `Continuity.step`; empty ones do not count.

    Returns
    -------
    Metrics
        `continuity_max` and `pop_max` in mm/deg, `unexplained_max` in mm, and `pops`, the number of frames
        whose `pop` is above `POP`. Empty without steps.
    """
    found = [step for step in steps if step]
    if not found:
        return {}

    def worst(name: str) -> float:
        return max(float(step[name]) for step in found)

    return {
        "continuity_max": (worst("continuity"), "mm/deg"),
        "pop_max": (worst("pop"), "mm/deg"),
        "unexplained_max": (worst("unexplained"), "mm"),
        "pops": (float(sum(float(step["pop"]) > POP for step in found)), "frames"),
    }
