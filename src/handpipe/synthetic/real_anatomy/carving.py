"""Real bones made fit to move: carved where they would enter one another, and filled with marrow."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from handpipe.core import Array, InputError, IntArray, RigidTransform
from handpipe.mesh.generation import implicit as grids
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.acquisition import image, sampled
from handpipe.synthetic.geometry.implicit import Implicit
from handpipe.synthetic.geometry.kinematics import Posture, smoothstep

Surface = tuple[Array, IntArray]
Pair = tuple[str, str]
log = logging.getLogger(__name__)

SPACING = 0.5  # mm of the grids
REACH = 2.0  # mm up to which distances are exact: more than any carving or cortex is deep


def carved(own: Array, at: Array, others: Iterable[tuple[Implicit, RigidTransform]], gap: float) -> Array:
    """A shape's values (n,) at points (n, 3), less what others come nearer to than `gap` when they move.

    The cut runs midway between both surfaces, so that each bone loses half. `own` are the shape's values;
    each other shape comes with the motion that carries our points into its frame.
    """
    result = own.copy()
    for shape, motion in others:
        result = np.maximum(result, 0.5 * (own - shape(motion(at)) + gap))
    return result


def without_handles(surface: Surface, name: str) -> Surface:
    """A closed surface like a ball's: small tunnels through it are closed by moving it out and in again.

    Raises
    ------
    InputError
        If tunnels stay open.
    """
    if _like_a_ball(Mesh(*surface)):
        return surface
    grid = grids.Grid.around(surface[0], 2.0, 0.5 * SPACING)
    own = _distances(surface, grid)
    for distance in (0.25, 0.5, 0.75, 1.0):
        outer = grids.isosurface(own, grid, distance)
        closed = _distances((outer.vertices, outer.triangles), grid)
        mesh = grids.isosurface(closed, grid, -distance).largest_component().compact()
        if _like_a_ball(mesh):
            log.info("%s: tunnels closed that are up to %.1f mm wide", name, 2.0 * distance)
            return mesh.vertices, mesh.triangles
    raise InputError(name, "surface", "has a tunnel wider than 2 mm", "Mend it in a mesh editor")


def kept_apart(
    bones: Mapping[str, Surface], pairs: Iterable[Pair], postures: Sequence[Posture], gap: float
) -> dict[str, Surface]:
    """Neutral bones carved so that the pairs that may touch stay `gap` mm apart in every posture."""
    shapes = {name: sampled.of_surface(surface, SPACING, REACH) for name, surface in bones.items()}
    moves = [posture.transforms() for posture in postures]
    beside: dict[str, list[str]] = {name: [] for name in bones}
    for one, other in pairs:
        beside[one].append(other)
        beside[other].append(one)
    result = {}
    for name, surface in bones.items():
        grid = grids.Grid.around(surface[0], 2.0, SPACING)
        at = grid.points()
        values = shapes[name](at)
        near = np.flatnonzero((values > -REACH) & (values < 1.0))
        others = (
            (shapes[other], motion)
            for other in beside[name]
            for motion in _distinct([t[other].inverse() @ t[name] for t in moves])
        )
        cut = carved(values[near], at[near], others, gap)
        lost = -values[near][(cut > 0.0) & (values[near] < 0.0)]
        share = 100.0 * len(lost) / max((values < 0.0).sum(), 1)
        deepest = lost.max(initial=0.0)
        log.info("%s: carved up to %.1f mm deep, %.1f %% of it, to keep bones apart", name, deepest, share)
        values[near] = cut
        mesh = grids.isosurface(values, grid).largest_component().compact()
        result[name] = mesh.vertices, mesh.triangles
    return result


def marrow(bone: Surface, shape: Implicit, frame: RigidTransform, shaft: float, ends: float) -> Surface:
    """The bone's surface moved inwards by `shaft` mm along its shaft and `ends` mm under its joints.

    shape: its signed distance; frame: the bone's own, with +x along it.
    """
    grid = grids.Grid.around(bone[0], 1.0, SPACING)
    along = frame.inverse()(bone[0])[:, 0]
    at = grid.points()
    x = frame.inverse()(at)[:, 0]
    from_end = np.minimum(x - along.min(), along.max() - x) / np.ptp(along)
    thickness = ends + (shaft - ends) * smoothstep(from_end, 0.1, 0.3)
    mesh = grids.isosurface(shape(at) + thickness, grid).largest_component().compact()
    return mesh.vertices, mesh.triangles


def _like_a_ball(surface: Mesh) -> bool:
    """Whether a connected closed surface has no tunnels (Euler)."""
    used = len(np.unique(surface.triangles))
    return used - len(surface.edges()) + len(surface.triangles) == 2


def _distances(surface: Surface, grid: grids.Grid) -> Array:
    """Signed distances of the grid's points to a surface."""
    return image.signed_distance(surface, image.VoxelGrid(grid.shape, grid.origin, grid.spacing), REACH)


def _distinct(motions: Sequence[RigidTransform]) -> list[RigidTransform]:
    """The motions without repetitions: bones that move as one have one."""
    kept: list[RigidTransform] = []
    for motion in motions:
        if not any(
            np.allclose(motion.rotation, k.rotation, atol=1e-9)
            and np.allclose(motion.translation, k.translation, atol=1e-6)
            for k in kept
        ):
            kept.append(motion)
    return kept
