"""A layer of the simulation: it names the layers it needs and computes its shape from theirs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

from numpy.typing import NDArray

from handpipe.core.arrays import Array, IntArray
from handpipe.core.rigid import RigidTransform


@dataclass(frozen=True)
class Frame:
    """One pose to be simulated: joint angles in rad, and each bone's transform from neutral."""

    name: str
    angles: Mapping[str, float]
    bones: Mapping[str, RigidTransform]


@dataclass
class Shape:
    """One body in one frame.

    rest, vertices (n, 3) in mm: neutral and present positions of the same points;
    cells (k, 3) triangles, (k, 4) tetrahedra or (k, 2) segments; fields: arrays over points or cells;
    figures: what its solver says of itself.
    """

    rest: Array
    vertices: Array
    cells: IntArray
    fields: dict[str, NDArray] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)


class Region(IntEnum):
    """How the fat is held at a point of an inner surface (Zheng 2022 §7.1); field "region" of a `Shape`."""

    contact = 0
    sliding = 1
    fixed = 2


Shapes = dict[str, Shape]  # by the body's name: "distal2", "flexor", ...


def flesh_in(below: Mapping[str, Shapes]) -> Array | None:
    """Vertices (n, 3) of the flesh that carries what lies in it, where it has been simulated."""
    return below["flesh"]["flesh_mesh"].vertices if "flesh" in below else None


def vertices_of(shapes: Shapes) -> dict[str, Array]:
    """Vertices (k, 3) of posed bodies, by name."""
    return {name: shape.vertices for name, shape in shapes.items()}


class Layer(Protocol):
    """A tissue of the simulation. `solve` is a static equilibrium: frames do not depend on one another."""

    name: str
    needs: tuple[str, ...]

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The layer's bodies in a frame, from the bodies of the layers it needs, by layer name.

        Raises `ConvergenceError` where no equilibrium was found.
        """
        ...
