"""Sections through the finger whose tissues slide.

`python -m benchmarks.truth.sliding BODY OUT.png POSE.h5 …`: poses are files of the rule
`sliding_pose`, neutral first.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from matplotlib.collections import LineCollection

from handpipe.core import Array, IntArray
from handpipe.synthetic.sliding import finger_poses, finger_subject
from handpipe.synthetic.sliding.sliding_body import SlidingBody

# A place in mm, a normal, and the axes that are drawn: across the bellies, through them, through the bones.
SECTIONS = (
    ("x = 33 mm", (33.0, 0.0, 0.0), 0, (1, 2)),
    ("y = 9 mm", (0.0, 9.0, 0.0), 1, (0, 2)),
    ("y = 0 mm", (0.0, 0.0, 0.0), 1, (0, 2)),
)
COLOURS = {"fat": "goldenrod", "bone": "dimgray"}


def surfaces(body: SlidingBody, pose: str, x: Array) -> list[tuple[str, Array, IntArray]]:
    """Colour, vertices and triangles of all surfaces in a pose at x (n, 3)."""
    where = finger_poses.pose_at(body, pose)
    found = [(COLOURS["fat"], x, body.faces_of("fat"))]
    found += [("firebrick", x, body.faces_of(name)) for name in body.muscles]
    bones = body.bones.items()
    return found + [(COLOURS["bone"], where.bones[n](b.vertices), b.triangles) for n, b in bones]


def draw(body: SlidingBody, poses: dict[str, Array], path: Path) -> None:
    """A row of sections a pose."""
    figure, axes = plt.subplots(len(poses), len(SECTIONS), figsize=(13, 4.2 * len(poses)), squeeze=False)
    for row, (pose, x) in zip(axes, poses.items(), strict=True):
        for axis, (name, place, normal, drawn) in zip(row, SECTIONS, strict=True):
            for colour, vertices, triangles in surfaces(body, pose, x):
                mesh = trimesh.Trimesh(vertices, triangles, process=False)
                lines = trimesh.intersections.mesh_plane(mesh, np.eye(3)[normal], place)
                axis.add_collection(LineCollection(lines[:, :, list(drawn)], colors=colour, linewidths=0.9))
            axis.autoscale()
            axis.set_aspect("equal")
            axis.set_title(f"{pose}, {name}")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    given, target, *files = (Path(a) for a in sys.argv[1:])
    draw(finger_poses.load_body(given), {f.stem: finger_subject.load(f) for f in files}, target)
