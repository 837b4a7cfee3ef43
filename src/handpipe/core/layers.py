"""A layer of the simulation: it names the layers it needs and computes its shape from theirs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from handpipe.core.arrays import Array, IntArray
from handpipe.core.rigid import RigidTransform


@dataclass(frozen=True)
class Frame:
    """One pose to simulate.

    Parameters
    ----------
    name : str
        Name of the frame or pose.
    angles : mapping of str to float
        Joint angles in rad, by name.
    bones : mapping of str to RigidTransform
        Each bone's transform from the neutral pose.
    """

    name: str
    angles: Mapping[str, float]
    bones: Mapping[str, RigidTransform]


@dataclass
class Shape:
    """One body in one frame.

    Parameters
    ----------
    rest, vertices : array (n, 3)
        Neutral and present positions of the same points in mm.
    cells : array (k, 3), (k, 4) or (k, 2) of int
        Vertices of triangles, tetrahedra or segments.
    fields : dict of str to array
        Values over points or cells, by name.
    figures : dict of str to float
        What the solver measured on its own result, by name.
    """

    rest: Array
    vertices: Array
    cells: IntArray
    fields: dict[str, NDArray] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)


class Region(IntEnum):
    """The fat's constraint at a point of an inner surface (Zheng 2022 §7.1); field "region" of a `Shape`."""

    contact = 0
    sliding = 1
    fixed = 2


def without_sliding(regions: IntArray) -> IntArray:
    """The regions of points, fixed where they slide.

    Parameters
    ----------
    regions : array (n,) of int
        Values of `Region`.

    Returns
    -------
    array (n,) of int
        Values of `Region`: fixed or contact.
    """
    return np.where(regions == Region.sliding, Region.fixed, regions).astype(regions.dtype)


Shapes = dict[str, Shape]  # by the body's name: "distal2", "flexor", ...


def flesh_in(below: Mapping[str, Shapes]) -> Array | None:
    """Vertices of the simulated flesh, which carries the tendons and muscles inside it.

    Parameters
    ----------
    below : mapping of str to Shapes
        Simulated bodies of the layers below, by layer name.

    Returns
    -------
    array (n, 3) or None
        Positions in mm; None where the flesh has not been simulated.
    """
    return below["flesh"]["flesh_mesh"].vertices if "flesh" in below else None


def vertices_of(shapes: Shapes) -> dict[str, Array]:
    """The vertices of simulated bodies.

    Parameters
    ----------
    shapes : dict of str to Shape
        Bodies by name.

    Returns
    -------
    dict of str to array (k, 3)
        Positions in mm, by the body's name.
    """
    return {name: shape.vertices for name, shape in shapes.items()}


SimulatedFrame = tuple[Frame, Mapping[str, Shapes]]  # with the shapes by layer and body


class Layer(Protocol):
    """A tissue of the simulation. `solve` is a static equilibrium, which depends on no other frame."""

    name: str
    needs: tuple[str, ...]

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The layer's bodies in a frame.

        Parameters
        ----------
        frame : Frame
            Pose to simulate.
        below : mapping of str to Shapes
            Bodies of the layers that this one needs, by layer name.

        Returns
        -------
        Shapes
            Bodies by name.

        Raises
        ------
        ConvergenceError
            Where no equilibrium was found.
        """
        ...


@runtime_checkable
class FollowingLayer(Layer, Protocol):
    """A layer that can start from where it is in another frame, which saves most of the way."""

    def solve_after(self, before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `solve`, near the layer's shapes in another frame.

        Parameters
        ----------
        before : SimulatedFrame
            The other frame, with the shapes of this layer and of those that it needs.
        frame : Frame
            Pose to simulate.
        below : mapping of str to Shapes
            Bodies of the layers that this one needs, by layer name.

        Returns
        -------
        Shapes
            Bodies by name.

        Raises
        ------
        ConvergenceError
            Where no equilibrium was found.
        """
        ...
