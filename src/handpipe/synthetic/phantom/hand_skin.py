"""The skin of a generated hand in neutral: the outline of its images, closed and cut at the wrist.

The images' outline has no room for muscles of their real size, and knuckles stand out of it: more cones make
the palm thicker and round off its thenar and hypothenar side.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from handpipe.mesh.generation import Grid, isosurface, remesh, without_handles
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.phantom.hand_tissue import Cone, Layout, cone_rows, field_of_cones, skin

WRIST = -30.0  # mm along x, behind the carpals, where the hand is cut
ROUNDING = 6.0  # mm of the cut's edge
SPACING = 1.2  # mm of the grid that is contoured
CREASE = 1.5  # mm, standard deviation of the smoothing of creases
KNOWN = 5.0  # mm around the surface where the field is a distance
BLEND = 3.0  # mm over which cones run into one another: less than the images', whose fingers touch


def skin_surface(layout: Layout, edge_length: float) -> Surface:
    """The closed outline with triangles of about `edge_length` mm."""
    rows = cone_rows([*skin(layout), *flesh(layout)], layout.frames)
    near = rows[:, [0, 3]].max(axis=1) > WRIST
    ends = rows[near, :6].reshape(-1, 3)
    ends = ends[ends[:, 0] > WRIST - ROUNDING]
    grid = Grid.around(ends, float(rows[:, 6:].max()) + 2 * SPACING, SPACING)
    outline = field_of_cones(rows[near], grid, BLEND).astype(np.float64)
    beyond = WRIST - grid.points()[:, 0].reshape(grid.shape)
    h = np.maximum(ROUNDING - np.abs(outline - beyond), 0.0) / ROUNDING
    closed = np.maximum(outline, beyond) + 0.25 * ROUNDING * h**2
    # The field is no distance far from the surface; creases are rounded so that triangles can follow.
    smooth = gaussian_filter(np.clip(closed, -KNOWN, KNOWN), CREASE / SPACING)
    # Fingers of some hands touch at single places.
    outer, _ = without_handles(isosurface(smooth, grid).largest_component())
    return remesh(outer, edge_length)


def flesh(layout: Layout) -> list[Cone]:
    """Cones around what the images' outline is too tight for."""
    cones = []
    for ray, chain in layout.chains.items():
        for name, length, girth in chain:
            if name.startswith("metacarpal"):
                cones.append(Cone((name, (0, 0, 1.0)), (name, (length, 0, 1.0)), 11.0, 11.3 * girth**0.5))
                if ray > 1:
                    cones.append(Cone((name, (0, 0, -8.5)), (name, (0.95 * length, 0, -7.5)), 10.5, 10.0))
            elif not name.startswith("distal"):
                radius = 9.0 if name.startswith("proximal") else 7.6
                size = radius * girth**0.5, (radius - 1.0) * girth**0.5
                cones += [Cone((name, (0, 0, z)), (name, (length, 0, z)), *size) for z in (-3.4, 0.6)]
    between = [
        Cone(("trapezium", (0, -2, -9)), ("metacarpal1", (38, -1, -6)), 14.0, 13.5),
        Cone(("trapezium", (4, -8, -11)), ("metacarpal1", (42, -7, -5)), 12.5, 10.5),
        Cone(("hamate", (-2, -5, -8)), ("metacarpal5", (50, -3, -4)), 14.0, 12.5),
        Cone(("metacarpal1", (30, -8, -1)), ("metacarpal2", (40, 4, -3)), 9.0, 10.0),
        Cone(("metacarpal1", (16, -6, 1)), ("metacarpal2", (24, 4, 0)), 11.0, 11.0),
        Cone(("metacarpal1", (48, -6, -1)), ("metacarpal2", (50, 3, -7)), 10.5, 11.0),
        Cone(("metacarpal2", (14, 5, 1)), ("metacarpal2", (62, 5, -1)), 12.0, 10.0),
    ]
    # A lean hand's wrist is no thinner: little but skin lies on the carpals.
    wrist = [
        Cone(("trapezium", (0, 0, 1)), ("hamate", (0, 0, 1)), 11.5, 11.0),
        Cone(("trapezium", (0, 0, -6)), ("hamate", (0, 0, -8)), 12.0, 12.0),
    ]
    return [*layout.fleshed([*cones, *layout.stretched(between)]), *layout.stretched(wrist)]
