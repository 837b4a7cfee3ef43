"""A lower leg of round cones, as an example that is no hand: skin, four bones, and where its muscles begin.

The x axis runs from the knee to the ankle, z to the front. It is a toy: its sizes are an adult's, its shapes
are not.
"""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.mesh.generation import Grid, isosurface, remesh
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.geometry.implicit import Implicit, round_cone, smooth_union

Cone = tuple[tuple[float, float, float], tuple[float, float, float], float, float]

# mm: both ends of each cone and its radii there
BONES: dict[str, tuple[Cone, ...]] = {
    "femur": (((-92, 0, 4), (-45, 0, 2), 13, 17), ((-45, 0, 2), (-30, 0, 0), 17, 21)),
    "tibia": (
        ((18, 0, 4), (70, 0, 8), 20, 13),
        ((70, 0, 8), (285, 0, 6), 13, 10),
        ((285, 0, 6), (318, 0, 2), 10, 15),
    ),
    "fibula": (((50, 31, -8), (290, 27, -6), 7, 6), ((290, 27, -6), (326, 27, -4), 6, 8)),
    "foot": (((366, 4, 4), (388, 4, -44), 17, 17), ((370, 4, 8), (394, 2, 118), 17, 10)),
}
# mm: the same of the skin
SKIN: tuple[Cone, ...] = (
    ((-80, 0, 0), (10, 0, 0), 60, 54),
    ((10, 0, 0), (110, 4, -12), 54, 57),
    ((110, 4, -12), (290, 6, -2), 57, 36),
    ((290, 6, -2), (366, 5, 0), 36, 38),
    ((366, 5, 0), (388, 5, -46), 36, 33),
    ((372, 5, 6), (394, 3, 122), 38, 25),
)
BLENDS = {"skin": 25.0, "bone": 8.0}  # mm over which cones are rounded where they meet
EDGES = {"skin": 8.0, "bone": 5.0}  # mm, of triangles
SPACING = 0.7  # of the grid on which surfaces are found, over their edges


def leg_surfaces(finer: float = 1.0) -> tuple[Surface, dict[str, Surface]]:
    """Skin and bones of the lower leg.

    Parameters
    ----------
    finer : float
        Divides the length of edges: 8 mm of the skin, 5 mm of bones.

    Returns
    -------
    skin : Surface
        Closed, in mm.
    bones : dict of str to Surface
        Closed surfaces in mm by bone, apart from one another.
    """
    skin = _surface(SKIN, "skin", finer)
    return skin, {name: _surface(cones, "bone", finer) for name, cones in BONES.items()}


def _surface(cones: tuple[Cone, ...], kind: str, finer: float) -> Surface:
    edge = EDGES[kind] / finer
    shape: Implicit = smooth_union([round_cone(*cone) for cone in cones], BLENDS[kind])
    ends: Array = np.array([end for a, b, *_ in cones for end in (a, b)], dtype=float)
    widest = max(max(radii) for _, _, *radii in cones)
    grid = Grid.around(ends, widest + BLENDS[kind], SPACING * edge)
    return remesh(isosurface(shape(grid.points()), grid), edge)
