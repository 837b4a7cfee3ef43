"""A toy forearm: one bone in the middle of a limb, and muscles along it."""

import numpy as np

from handpipe.mesh.generation.implicit import Grid, isosurface
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface


def capsule(start: float, end: float, radius: float, edge_length: float) -> Surface:
    """A tube along x with round ends."""
    ends = np.array([[start, 0, 0], [end, 0, 0]], dtype=float)
    grid = Grid.around(ends, radius + edge_length, 0.7 * edge_length)
    points = grid.points()
    nearest = np.column_stack([np.clip(points[:, 0], start, end), np.zeros((len(points), 2))])
    values = np.linalg.norm(points - nearest, axis=1) - radius
    return remesh(isosurface(values, grid), edge_length)


def arm(edge_length: float) -> tuple[Surface, dict[str, Surface]]:
    """The skin, 100 mm long, and a bone of 70 mm inside of it."""
    skin = capsule(-30.0, 30.0, 20.0, edge_length)
    return skin, {"radius": capsule(-30.0, 30.0, 5.0, edge_length)}


THREE_MUSCLES = """
units: mm
distal: [1, 0, 0]
fat: 0.3
muscles:
  flexor:
    curves:
      - points:
          - {bone: radius, along: 0.1, towards: [0, 0, -1], tissue: 1}
          - {at: [0, 0, -12], tissue: 1.5}
          - {bone: radius, along: 0.9, towards: [0, 0, -1], tissue: 1}
  extensor:
    curves:
      - points:
          - {bone: radius, along: 0.1, towards: [0, 0.8, 0.6], tissue: 1}
          - {at: [0, 9.6, 7.2], tissue: 1}
          - {bone: radius, along: 0.9, towards: [0, 0.8, 0.6], tissue: 1}
  abductor:
    curves:
      - points:
          - {bone: radius, along: 0.3, towards: [0, -0.8, 0.6], tissue: 1}
          - {at: [5, -8.8, 6.6], tissue: 1}
          - {bone: radius, along: 0.9, towards: [0, -0.8, 0.6], tissue: 1}
"""
