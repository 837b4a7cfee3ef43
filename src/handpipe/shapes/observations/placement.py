"""Where a template is put before its shape is changed: by pairs of points, or by its marks alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.marks import BoundaryMarks
from handpipe.shapes.observations.rigid_motions import LooseMotions
from handpipe.shapes.observations.straight import direction, on_line

ROUNDS = 15  # of one start, at most
CLEARLY = 0.7  # of the distance of marks: a turn is only believed where it brings so much
FLIPS = [np.diag(d) for d in ([1.0, 1, 1], [1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])]


def placed(mesh: TetMesh, pairs: list[Attached], marks: BoundaryMarks) -> Array:
    """Vertices (n, 3) of the template placed rigidly.

    By pairs where three of them are not nearly on a line; by the marks about the line where they are; else by
    the marks, from the template's own orientation or one in which its principal axes are those of the marks,
    whichever brings them clearly nearer.
    """
    x = mesh.vertices
    points = np.concatenate([p.matrix @ x for p in pairs]) if pairs else np.zeros((0, 3))
    targets = np.concatenate([p.targets for p in pairs]) if pairs else np.zeros((0, 3))
    if len(points) >= 3 and not (on_line(points) or on_line(targets)):
        return RigidTransform.fit(points, targets)(x)
    if len(points):
        starts = _along(x, points, targets)
        return starts[0] if len(marks.points) == 0 else _nearest(starts, marks)
    if len(marks.points) == 0:
        return x
    surface = x[mesh.boundary_vertices()]
    centre, wanted = surface.mean(axis=0), marks.points.mean(axis=0)
    axes, aims = _axes(surface), _axes(marks.points)
    turns = [np.eye(3), *(aims @ flip @ axes.T for flip in FLIPS)]
    return _nearest([(x - centre) @ turn.T + wanted for turn in turns], marks)


def _along(x: Array, points: Array, targets: Array) -> list[Array]:
    """Vertices (n, 3) whose points (k, 3) are along the targets' line, in four turns about it."""
    centred, aims = points - points.mean(axis=0), targets - targets.mean(axis=0)
    if len(points) == 1:
        return [x - points[0] + targets[0]]
    line, aim = direction(points)[0], direction(targets)[0]
    aim = aim * np.sign((centred @ line) @ (aims @ aim) or 1.0)
    onto = Rotation.align_vectors(aim[None], line[None])[0]
    turns = [Rotation.from_rotvec(0.5 * np.pi * quarter * aim) * onto for quarter in range(4)]
    return [(x - points.mean(axis=0)) @ turn.as_matrix().T + targets.mean(axis=0) for turn in turns]


def _axes(points: Array) -> Array:
    """Principal axes (3, 3) in columns, a rotation."""
    axes = np.linalg.eigh(np.cov(points.T))[1]
    return axes if np.linalg.det(axes) > 0 else axes * [1.0, 1.0, -1.0]


def _nearest(starts: list[Array], marks: BoundaryMarks) -> Array:
    """The start that closest points bring nearest to the marks; the first if no other is clearly nearer."""
    best, least = starts[0], np.inf
    for number, start in enumerate(starts):
        x = start
        free = LooseMotions(np.zeros((0, 3)), x)
        for _ in range(ROUNDS):
            x = free.settled(x, marks(x))
        distance = float(np.sqrt((marks.distances(x) ** 2).mean()))
        if distance < (least if number == 0 else CLEARLY * least):
            best, least = x, distance
    return best
