"""A toy finger: two bones, a hinge, a flexor with its tendon, fat and skin. What the truth is tested on.

Right hand's frame: +x distal, +y radial, +z dorsal. The proximal bone's head is a sphere about the joint's
centre, so that the gap between the bones does not change as it turns.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.truth.filling import fill
from handpipe.core import Array, RigidTransform
from handpipe.fem.elements import Material
from handpipe.mesh.generation import Grid, isosurface, remesh
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledPose, TendonStrand

CENTRE = np.array([20.0, 0.0, 1.5])  # of the joint
BONE_RADIUS, GAP = 3.0, 2.0
PROXIMAL = (np.array([3.0, 0.0, 1.5]), CENTRE)  # ends of the axis
DISTAL = (CENTRE + [2 * BONE_RADIUS + GAP, 0.0, 0.0], CENTRE + [21.0, 0.0, 0.0])
SKIN, SKIN_RADIUS = (np.array([0.0, 0.0, 0.0]), np.array([44.0, 0.0, 0.0])), 9.0
DERMIS = 1.6  # thickness in mm
BELLY, BELLY_AXES = np.array([10.0, 0.0, -4.1]), np.array([8.0, 3.2, 1.9])  # the muscle, an ellipsoid

MATERIALS = {"skin": Material(20.0, 0.49), "fat": Material(1.0, 0.49), "flexor": Material(6.0, 0.499)}
TENDON = 2e4  # mN: Young's modulus times cross-section
TENSION = 8.0  # kPa of the flexor at 60 degrees


def finger(edge_length: float = 4.0) -> CoupledAnatomy:
    """The toy's anatomy with surface triangles of about `edge_length` mm."""
    surfaces = {
        "outer": _surface(lambda p: capsule(p, *SKIN) - SKIN_RADIUS, edge_length),
        "inner": _surface(lambda p: capsule(p, *SKIN) - SKIN_RADIUS + DERMIS, edge_length),
        "proximal": _surface(lambda p: capsule(p, *PROXIMAL) - BONE_RADIUS, 0.6 * edge_length),
        "distal": _surface(lambda p: capsule(p, *DISTAL) - BONE_RADIUS, 0.6 * edge_length),
        "belly": _surface(lambda p: _ellipsoid(p, BELLY, BELLY_AXES), 0.5 * edge_length),
    }
    regions = {
        "skin": ("outer", ["inner"]),
        "fat": ("inner", ["proximal", "distal", "belly"]),
        "flexor": ("belly", []),
    }
    mesh, labels, on = fill(surfaces, regions, edge_length)
    along = np.tile([1.0, 0.0, 0.0], (int((labels == 2).sum()), 1))
    bones = {name: on[name] for name in ("proximal", "distal")}
    return CoupledAnatomy(mesh, labels, tuple(regions), bones, {"flexor": along}, _strands())


def hinge(angle: float, activation: float = 1.0) -> CoupledPose:
    """The distal bone flexed by an angle in rad; the flexor pulls in proportion to it, times `activation`."""
    turn = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
    tension = activation * TENSION * max(angle, 0.0) / np.radians(60.0)
    bones = {"proximal": RigidTransform.identity(), "distal": RigidTransform.about(CENTRE, turn)}
    return CoupledPose(bones, {"flexor": tension})


def _strands() -> dict[str, TendonStrand]:
    """Three strands side by side: from the proximal bone into the belly, and out of it to the distal one."""
    strands = {}
    for name, side in (("radial", 1.0), ("central", 0.0), ("ulnar", -1.0)):
        origin = np.array([[3.5, 0.8 * side, CENTRE[2] - BONE_RADIUS], [4.3, 0.8 * side, -2.9]])
        behind = np.column_stack([np.linspace(5.0, 7.5, 4), np.full(4, 0.9 * side), np.full(4, -4.1)])
        ahead = np.column_stack([np.linspace(12.5, 15.5, 4), np.full(4, 0.9 * side), np.full(4, -4.1)])
        free = np.column_stack([np.linspace(17, 28, 8), np.full(8, 0.6 * side), np.linspace(-4, -2.2, 8)])
        end = np.array([[29.0, 0.6 * side, CENTRE[2] - BONE_RADIUS]])
        strands[f"{name} origin"] = TendonStrand(np.concatenate([origin, behind]), TENDON, {0: "proximal"})
        tendon = np.concatenate([ahead, free, end])
        strands[f"{name} tendon"] = TendonStrand(tendon, TENDON, {len(tendon) - 1: "distal"})
    return strands


def capsule_surface(start: Array, end: Array, radius: float, edge_length: float) -> Surface:
    """Triangles of about an edge length at a radius about a segment."""
    return _surface(lambda p: capsule(p, start, end) - radius, edge_length, (start - radius, end + radius))


def _surface(  # type: ignore[no-untyped-def]
    distance,
    edge_length: float,
    box: tuple[Array, Array] = (SKIN[0] - SKIN_RADIUS, SKIN[1] + SKIN_RADIUS),
) -> Surface:
    """Triangles of about an edge length on the zero set of a function of points in a box."""
    grid = Grid.around(np.array(box), 2.0, 0.6)
    return remesh(isosurface(distance(grid.points()), grid).largest_component(), edge_length)


def capsule(points: Array, start: Array, end: Array) -> Array:
    """Distances (n,) of points (n, 3) from a segment."""
    along = end - start
    t = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(points - start - t[:, None] * along, axis=1)


def _ellipsoid(points: Array, centre: Array, axes: Array) -> Array:
    """A function (n,) of points (n, 3), negative inside, near the distance at the surface."""
    scaled = np.linalg.norm((points - centre) / axes, axis=1)
    return (scaled - 1.0) * axes.min()
