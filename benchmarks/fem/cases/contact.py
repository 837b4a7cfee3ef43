"""Bodies pressed by bones, on both sides, and into themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from benchmarks.fem import scenes
from benchmarks.fem.cases.joint import joint_scene
from benchmarks.fem.cases.outcome import ACROSS_Y, STEPS, YOUNG, Outcome, case, largest
from benchmarks.fem.scenes import Body
from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.contact import Attachment, Barrier
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic, Potential, Pull
from handpipe.fem.solver import Steps, continuation
from handpipe.fem.solver.equilibrium import Record

SPRING = 20.0  # mN/mm a vertex
SMALL_STEPS = (1 / 8, 1 / 16)


def with_shells(
    body: Body, shells: Sequence[tuple[Array, IntArray]]
) -> tuple[Array, IntArray, list[NDArray]]:
    """Vertices of a body and of shells, all triangles, and each shell's vertex numbers."""
    vertices, triangles, parts = [body.vertices], [body.triangles], []
    count = len(body.vertices)
    for shell, faces in shells:
        vertices.append(shell)
        triangles.append(faces + count)
        parts.append(np.arange(count, count + len(shell)))
        count += len(shell)
    return np.concatenate(vertices), np.concatenate(triangles), parts


def by_two_paths(
    x: Array, potentials: Callable[[float], Sequence[Potential]], fixed: BoolArray
) -> tuple[Array, Record, float]:
    """End and record of large steps, and how far that is from an end of small ones, or its mirror image.

    Contact of faceted surfaces need not keep the scene's symmetry in y, nor has it one minimum: an edge slips
    off an edge, to this side or that, as steps fall. Energies of such ends differ by less than a thousandth.
    """
    found = continuation(potentials, x, fixed=fixed, options=STEPS)
    apart = []
    for step in SMALL_STEPS:
        other = continuation(
            potentials, x, fixed=fixed, options=STEPS, steps=Steps(first=step, largest=step)
        ).x
        image = other[scenes.mirror_images(x, ACROSS_Y)] @ ACROSS_Y
        apart += [largest(found.x - other), largest(found.x - image)]
    return found.x, found.record, min(apart)


ANOTHER_PATH = "in small steps, or its mirror image"


def pressed(
    body: Body,
    clamped: BoolArray,
    shells: Sequence[tuple[Array, IntArray]],
    ways: Sequence[Array],
    distance: float,
) -> Outcome:
    """Shells move by `ways` (3,) each, against a body of which `clamped` (n,) stays."""
    x, triangles, parts = with_shells(body, shells)
    every = sp.eye(len(x), format="csr")
    elastic = Elastic(x, body.tets, Material(YOUNG, 0.45))
    barrier = Barrier(every, triangles, x, distance, YOUNG)
    moving = np.concatenate(parts)
    way = np.concatenate([np.tile(w, (len(p), 1)) for w, p in zip(ways, parts, strict=True)])

    def potentials(t: float) -> list[Potential]:
        return [elastic, barrier, Attachment(every[moving], x[moving] + t * way, SPRING)]

    fixed = np.zeros(x.shape, dtype=bool)
    fixed[: len(clamped)][clamped] = True
    end, record, error = by_two_paths(x, potentials, fixed)
    free = ~fixed.ravel()
    return Outcome(x, end, record, elastic, triangles, free, potentials(1.0), error, ANOTHER_PATH)


@case("pinch", "a block pinched between two closing bones to two fifths of its thickness")
def pinch(refine: int) -> Outcome:
    step = 0.25 / refine
    body = scenes.mirrored_in_y(
        scenes.grid(
            np.arange(-1.0, 1.0 + step / 2, step),
            np.arange(0.0, 0.75 + step / 2, step),
            np.arange(-0.5, 0.5 + step / 2, step),
        )
    )
    shells = [scenes.sphere(0.5, (0.0, 0.0, side * 1.06), 2) for side in (-1.0, 1.0)]
    ways = [np.array([0.0, 0.0, -side * 0.36]) for side in (-1.0, 1.0)]
    return pressed(body, body.where(0, -1.0) | body.where(0, 1.0), shells, ways, 0.05)


@case("sheet", "a sheet 0.05 mm thin, pressed from both sides")
def sheet(refine: int) -> Outcome:
    step = 0.2 / refine
    body = scenes.mirrored_in_y(
        scenes.grid(
            np.arange(-1.0, 1.0 + step / 2, step),
            np.arange(0.0, 0.6 + step / 2, step),
            np.array([-0.025, 0.025]),
        )
    )
    clamped = body.where(0, -1.0) | body.where(0, 1.0)
    shells = [scenes.sphere(0.3, (side * 0.35, 0.0, side * 0.35), 2) for side in (-1.0, 1.0)]
    ways = [np.array([0.0, 0.0, -side * 0.25]) for side in (-1.0, 1.0)]
    return pressed(body, clamped, shells, ways, 0.02)


@case("self-contact-u", "a U whose arms are pressed together, their tips guided")
def self_contact_u(refine: int) -> Outcome:
    body = scenes.u_shape(refine)
    x = body.vertices
    every = sp.eye(len(x), format="csr")
    elastic = Elastic(x, body.tets, Material(YOUNG, 0.45))
    barrier = Barrier(every, body.triangles, x, 0.05, YOUNG)
    tips = np.flatnonzero(x[:, 0] > 2.9)
    forces = np.zeros((len(tips), 3))
    forces[:, 1] = -np.sign(x[tips, 1]) * 0.3 / (len(tips) / 2)

    def potentials(t: float) -> list[Potential]:
        return [elastic, barrier, Pull(every[tips], t * forces)]

    fixed = np.zeros(x.shape, dtype=bool)
    fixed[body.where(0, 0.0)] = True
    fixed[tips, 2] = True  # or the arms would slip past one another
    clamped = fixed.ravel()
    end, record, error = by_two_paths(x, potentials, clamped)
    return Outcome(x, end, record, elastic, body.triangles, ~clamped, potentials(1.0), error, ANOTHER_PATH)


@case("self-contact-finger", "a finger folded by 172°, its pad pressed into its base")
def self_contact_finger(refine: int) -> Outcome:
    body, proximal, distal = joint_scene(refine)
    x = body.vertices
    every = sp.eye(len(x), format="csr")
    elastic = Elastic(x, body.tets, Material(YOUNG, 0.45))
    barrier = Barrier(every, body.triangles, x, 0.03, YOUNG)

    def potentials(t: float) -> list[Potential]:
        target = scenes.turned(x, distal, (0, 1, 0), 172.0 * t, (0.1, 0.0, -0.34))[distal]
        return [elastic, barrier, Attachment(every[distal], target, SPRING)]

    clamped = np.repeat(proximal, 3)
    end, record, error = by_two_paths(x, potentials, clamped)
    # Facets that meet exactly have several equilibria; the axis and angle keep these from it.
    return Outcome(x, end, record, elastic, body.triangles, ~clamped, potentials(1.0), error, ANOTHER_PATH)
