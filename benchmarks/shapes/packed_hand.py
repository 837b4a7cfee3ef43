"""Seventeen muscles packed between five metacarpals, overlapping as muscles fitted one by one do."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from handpipe.mesh.surfaces import Surface

SIDES = 12  # parts of an icosahedron's edge: 10 SIDES^2 + 2 vertices
OVERLAP = 0.6  # mm by which a muscle is thicker than its room, on either side
RAYS = (-24.0, -8.0, 8.0, 24.0)  # mm from ulnar to radial, of the four fingers' metacarpals
BONE = (34.0, 4.0, 4.0)  # mm, half axes


def packed_hand(turn: float = 0.0, overlap: float = OVERLAP) -> tuple[dict[str, Surface], dict[str, Surface]]:
    """Muscles and bones by name; x distal, y radial, z dorsal, mm.

    turn: rad by which the thumb and the little finger's ray turn towards the palm, each taking its muscles
    along: another pose, with other overlaps.
    """
    muscles: dict[str, Surface] = {}
    for i in range(4):  # one dorsal interosseus between two metacarpals, the first beside the index finger's
        y = -16.0 + 16.0 * i
        muscles[f"dorsal-{i}"] = spindle((0, y, 0.5), (26, 4.0 + overlap, 4.5 + overlap))
        muscles[f"lumbrical-{i}"] = spindle((6, RAYS[i], -11.5), (24, 2.6 + overlap, 2.2 + overlap), bend=1.0)
    for i in range(3):
        muscles[f"palmar-{i}"] = spindle((2, -14.0 + 16.0 * i, -7.5), (24, 3.6 + overlap, 3.2 + overlap))
    for i in range(3):
        low = -3.0 - 5.6 * i
        thenar = spindle((-6, 29.0 - 2.0 * i, low - 5.0), (20, 5.0 + overlap, 2.8 + overlap), bend=3.0)
        little = spindle((-2, -33.5 + 0.5 * i, low + 3.5), (24, 3.4 + overlap, 2.8 + overlap), bend=-2.0)
        muscles[f"thenar-{i}"] = turned(thenar, (-24, 18, 0), (0.3, 0.2, 1.0), 0.6 + turn)
        muscles[f"hypothenar-{i}"] = turned(little, (-24, -24, 0), (1, 0, 0), -0.5 * turn)
    bones = {f"metacarpal-{i}": spindle((0, y, 0), BONE) for i, y in enumerate(RAYS)}
    bones["metacarpal-0"] = turned(bones["metacarpal-0"], (-24, -24, 0), (1, 0, 0), -0.5 * turn)
    thumb = spindle((-2, 33.5, -2), (24, 4.5, 4.5))
    bones["thumb"] = turned(thumb, (-24, 18, 0), (0.3, 0.2, 1.0), 0.6 + turn)
    return muscles, bones


def spindle(
    centre: tuple[float, float, float], radii: tuple[float, float, float], bend: float = 0.0
) -> Surface:
    """An ellipsoid along x whose ends are `bend` mm further towards the palm than its middle."""
    sphere = geodesic_sphere(SIDES)
    points = sphere.vertices * radii + np.array(centre)
    points[:, 2] -= bend * sphere.vertices[:, 0] ** 2
    return sphere.moved(points)


def turned(
    surface: Surface, origin: tuple[float, float, float], axis: tuple[float, float, float], angle: float
) -> Surface:
    """The surface turned about an axis through the origin."""
    return surface.moved(turned_points(surface.vertices, origin, axis, angle))


def turned_points(
    points: np.ndarray,
    origin: tuple[float, float, float],
    axis: tuple[float, float, float],
    angle: float,
) -> np.ndarray:
    """Points (n, 3) turned about an axis through the origin, by Rodrigues' formula."""
    k = np.array(axis) / np.linalg.norm(axis)
    arm = points - origin
    across = np.cross(k, arm)
    rotated = arm * np.cos(angle) + across * np.sin(angle) + np.outer(arm @ k, k) * (1 - np.cos(angle))
    return rotated + origin


def geodesic_sphere(sides: int) -> Surface:
    """Unit sphere of 20 sides^2 nearly equal triangles on 10 sides^2 + 2 vertices."""
    icosahedron = trimesh.creation.icosahedron()
    corners, faces = icosahedron.vertices, icosahedron.faces
    i, j = np.array([(i, j) for i in range(sides + 1) for j in range(sides + 1 - i)]).T
    weights = np.stack([sides - i - j, i, j], axis=1) / sides
    points = np.einsum("pc,fcd->fpd", weights, corners[faces]).reshape(-1, 3)
    number = {(a, b): n for n, (a, b) in enumerate(zip(i, j, strict=True))}
    cells = [(number[a, b], number[a + 1, b], number[a, b + 1]) for a, b in number if a + b < sides]
    cells += [
        (number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]) for a, b in number if a + b < sides - 1
    ]
    triangles = (np.array(cells)[None] + len(weights) * np.arange(len(faces))[:, None, None]).reshape(-1, 3)
    first = np.array([min(same) for same in cKDTree(points).query_ball_point(points, 1e-9)])
    sphere = Surface(points / np.linalg.norm(points, axis=1, keepdims=True), first[triangles])
    return sphere.compact()
