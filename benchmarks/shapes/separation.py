"""Separation of seventeen packed muscles in six poses: seconds, and whether what it claims is true."""

from __future__ import annotations

import time
from collections.abc import Mapping
from itertools import permutations

import igl
import numpy as np

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.packed_hand import packed_hand
from handpipe.mesh.surfaces import Surface, sample_points
from handpipe.mesh.tets import cotangent_laplacian, mass_lumped
from handpipe.tissues.muscles.separation import separate
from handpipe.tissues.muscles.separation.separation import SeparationOptions

TURNS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)  # rad, of the thumb away from the palm
OVERLAPS = (0.3, 0.6, 0.9)  # mm
SAMPLES = 20_000  # points of a surface looked up in every other one


def measure(turns: tuple[float, ...] = TURNS, overlaps: tuple[float, ...] = OVERLAPS) -> Figures:
    """`separation_…`: the poses at the default overlap, and the first pose at several overlaps."""
    rows = [separated(*packed_hand(turn)) for turn in turns]
    figures: Figures = {"separation_poses": figure(len(turns), "1")}
    for name in ("seconds", "iterations"):
        figures[f"separation_{name}"] = figure(sum(row[name] for row in rows), UNITS[name])
    for name in ("before", "penetration", "volume_change", "roughness", "farthest"):
        figures[f"separation_{name}_max"] = figure(max(row[name] for row in rows), UNITS[name])
    for overlap in overlaps:
        row = separated(*packed_hand(overlap=overlap))
        figures |= {f"separation_overlap_{overlap}_{n}": figure(row[n], UNITS[n]) for n in row}
    return figures


UNITS = {
    "seconds": "s",
    "iterations": "1",
    "before": "mm",
    "penetration": "mm",
    "volume_change": "1",
    "roughness": "1",
    "farthest": "mm",
}


def separated(muscles: Mapping[str, Surface], bones: Mapping[str, Surface]) -> dict[str, float]:
    """What one pose took in processor seconds, and measures of the surfaces found."""
    begun = time.process_time()
    found = separate(muscles, bones)
    seconds = time.process_time() - begun
    shifts = {n: found.surfaces[n].vertices - s.vertices for n, s in muscles.items()}
    return {
        "seconds": seconds,
        "iterations": float(found.iterations),
        "before": deepest(muscles, bones),
        "penetration": deepest(found.surfaces, bones),
        "volume_change": max(abs(found.surfaces[n].volume() / s.volume() - 1) for n, s in muscles.items()),
        "roughness": max(roughness(s, shifts[n]) for n, s in muscles.items()),
        "farthest": max(float(np.linalg.norm(u, axis=1).max()) for u in shifts.values()),
    }


def deepest(muscles: Mapping[str, Surface], bones: Mapping[str, Surface]) -> float:
    """Depth in mm of random points of any surface in another, by winding numbers, which the method does not
    steer by."""
    every = [*muscles.values(), *bones.values()]
    points = [np.concatenate([s.vertices, sample_points(s, SAMPLES)]) for s in every]
    depths = [0.0]
    for i, j in permutations(range(len(every)), 2):
        if min(i, j) < len(muscles):  # bones may overlap one another
            depths.append(_depth(points[i], every[j]))
    return max(depths)


def _depth(points: np.ndarray, surface: Surface) -> float:
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    near = points[((points > low) & (points < high)).all(axis=1)]
    if len(near) == 0:
        return 0.0
    near = near[igl.fast_winding_number(surface.vertices, surface.triangles, near) > 0.5]
    if len(near) == 0:
        return 0.0
    squared = igl.point_mesh_squared_distance(near, surface.vertices, surface.triangles)[0]
    return float(np.sqrt(squared.max()))


def roughness(surface: Surface, shift: np.ndarray) -> float:
    """Root of the integral of |lap u|^2 over that of |u|^2, times the default reach squared: below one for a
    displacement that varies over more than the reach."""
    mass = mass_lumped(surface.vertices, surface.triangles)
    curvature = cotangent_laplacian(surface.vertices, surface.triangles) @ shift / mass[:, None]
    size = float(mass @ (shift**2).sum(axis=1))
    if size == 0.0:
        return 0.0
    return SeparationOptions().reach ** 2 * float(np.sqrt(mass @ (curvature**2).sum(axis=1) / size))
