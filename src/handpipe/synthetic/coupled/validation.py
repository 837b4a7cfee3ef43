"""Checks of a coupled truth by itself: patch test, refinement, muscles' volumes, different starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from handpipe.core import Array, Metrics
from handpipe.fem.elements import Material
from handpipe.fem.solver import Options, solve
from handpipe.mesh.tets import EDGES
from handpipe.synthetic.continuum.solid import Solid
from handpipe.synthetic.coupled.coupled_body import CoupledBody, CoupledPose
from handpipe.synthetic.coupled.follow import follow

AFFINE = np.array([[1.10, 0.08, -0.05], [0.03, 0.93, 0.06], [-0.04, 0.02, 1.02]])
SHAKEN = 0.1  # of the shortest edge at a node: where inner nodes start the patch test from


def patch_test(body: CoupledBody) -> float:
    """Largest distance of an inner node from an affine map that is prescribed on all outer nodes.

    The whole mesh gets one material, with Poisson's ratio 0.49: then the map is the equilibrium on any mesh.
    Inner nodes start away from it.

    Parameters
    ----------
    body : CoupledBody
        Coupled body whose elements are tested.

    Returns
    -------
    float
        Distance in mm; zero but for rounding and the solver's tolerances if the elements are right.
    """
    solid = Solid(body.elements, Material(1.0, 0.49))
    wanted = body.rest @ AFFINE.T
    outer = np.zeros(len(wanted), dtype=bool)
    outer[np.unique(body.cells.boundary_faces()[0])] = True  # skin, bones, and cavities where joints open
    noise = SHAKEN * _shortest_edges(body)[:, None] * np.random.default_rng(0).uniform(-1, 1, wanted.shape)
    start = np.where(outer[:, None], wanted, wanted + noise)
    options = Options(
        displacement_tolerance=1e-9, force_tolerance=1e-10, name="patch test", coarse=body.coarse
    )
    found = solve([solid], start, fixed=np.repeat(outer, 3), options=options).x
    return float(np.linalg.norm(found - wanted, axis=1).max())


def _shortest_edges(body: CoupledBody) -> Array:
    """Length (n,) in mm of the shortest edge between nodes at each."""
    ends = body.cells.tets[:, EDGES].reshape(-1, 2)
    lengths = np.linalg.norm(body.rest[ends[:, 0]] - body.rest[ends[:, 1]], axis=1)
    shortest = np.full(len(body.rest), np.inf)
    np.minimum.at(shortest, ends.ravel(), np.repeat(lengths, 2))
    return shortest


def node_volumes(body: CoupledBody) -> Array:
    """Volume (n,) in mm^3 that each node stands for: a quarter of the tets between nodes around it."""
    volumes = np.zeros(len(body.rest))
    np.add.at(volumes, body.cells.tets, body.cells.volumes()[:, None] / 4)
    return volumes


def difference(body: CoupledBody, x: Array, reference: CoupledBody, x_reference: Array) -> Metrics:
    """How far displacements of a body are from those of a finer one of the same shape.

    `rms` over the volume and `max` in mm, and the largest displacement, to compare with.
    """
    error = np.linalg.norm(carried(body, x, reference) - x_reference, axis=1)
    weights = node_volumes(reference)
    rms = float(np.sqrt(weights @ error**2 / weights.sum()))
    largest = float(np.linalg.norm(x_reference - reference.rest, axis=1).max())
    return {"rms": (rms, "mm"), "max": (float(error.max()), "mm"), "displacement": (largest, "mm")}


def carried(coarse: CoupledBody, x: Array, fine: CoupledBody) -> Array:
    """Positions (n, 3) of a finer body's nodes where the coarse one's positions x have them."""
    return fine.rest + coarse.elements.interpolation(fine.rest) @ (x - coarse.rest)


def observed_order(errors: Sequence[float]) -> float:
    """Order of convergence by errors at edge lengths that halve: the slope of their least-squares line."""
    levels = np.arange(len(errors))
    return float(-np.polyfit(levels, np.log2(errors), 1)[0])


def order_without_reference(coarse: float, fine: float) -> tuple[float, float]:
    """Order, and the finest body's own error in mm, by the distances of two bodies from it.

    Edge lengths halve from one to the next and errors fall as E, r E, r^2 E: the distances are (1 - r^2) E
    and (r - r^2) E. Distances from the finest alone make the order look higher than it is.
    """
    ratio = fine / coarse
    r = ratio / (1.0 - ratio)
    return float(-np.log2(r)), float(r**2 * coarse / (1.0 - r**2))


def volume_changes(body: CoupledBody, x: Array) -> dict[str, float]:
    """Change of each muscle's volume relative to rest.

    Parameters
    ----------
    body : CoupledBody
        Coupled body.
    x : array (n, 3)
        Positions of its nodes in mm.

    Returns
    -------
    dict of str to float
        Changes in percent by muscle.
    """
    return {
        name: 100.0 * (body.volume(name, x) / body.volume(name, body.rest) - 1.0) for name in body.muscles
    }


def start_difference(
    body: CoupledBody,
    detour: Callable[[float], CoupledPose],
    back: Callable[[float], CoupledPose],
    x: Array,
    *,
    steps: int = 4,
    options: Options | None = None,
) -> float:
    """Largest distance in mm of a node from x (n, 3), found from rest, when its pose is reached by a detour.

    `detour` leads from rest to another pose, `back` from there to that of x.
    """
    away = follow(body, detour, steps=steps, options=options).x
    again = follow(body, back, away, steps=steps, options=options).x
    return float(np.linalg.norm(again - x, axis=1).max())


def solved_from(
    coarse: CoupledBody, x: Array, fine: CoupledBody, pose: CoupledPose, options: Options | None = None
) -> Array:
    """The equilibrium (n, 3) of a finer body in a pose, from that of a coarse one."""
    start = fine.prescribed(pose, carried(coarse, x, fine))
    found = solve(fine.potentials(pose), start, fixed=fine.fixed, options=options)
    return found.x
