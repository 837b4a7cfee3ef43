"""A generic template hand: the anatomy on another mesh, through a smooth nonrigid warp; not the truth."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform, write_text


@dataclass(frozen=True)
class Distortion:
    """Scale about `centre`, a mild bend that curves the long axis, and a rigid change of frame."""

    centre: Array
    scale: float = 1.08  # of lengths
    bend: tuple[float, float] = (0.0007, -0.0005)  # 1/mm: how y and z grow with the square of x
    twist: float = 0.0012  # rad / mm about the long axis
    frame: RigidTransform = field(default_factory=RigidTransform.identity)

    def __call__(self, points: Array) -> Array:
        """Images (n, 3) in mm of points (n, 3) in mm."""
        p = points - self.centre
        c, s = np.cos(self.twist * p[:, 0]), np.sin(self.twist * p[:, 0])
        y, z = c * p[:, 1] - s * p[:, 2], s * p[:, 1] + c * p[:, 2]
        square = p[:, 0] ** 2
        bent = np.column_stack([p[:, 0], y + self.bend[0] * square, z + self.bend[1] * square])
        return self.frame(self.centre + self.scale * bent)


def inflate(points: Array, factor: float) -> Array:
    """Points of a tube along x scaled by `factor` about its middle line, less and less towards its ends."""
    x = points[:, 0]
    bins = np.linspace(x.min(), x.max(), 12)
    weights = np.exp(-(((x - bins[:, None]) / (bins[1] - bins[0])) ** 2))
    middle = weights @ points[:, 1:] / weights.sum(axis=1, keepdims=True)
    centre = np.column_stack([np.interp(x, bins, middle[:, d]) for d in range(2)])
    t = (x - x.min()) / (x.max() - x.min())
    grown = 1.0 + (factor - 1.0) * np.sin(np.pi * t) ** 2
    return np.column_stack([x, centre + grown[:, None] * (points[:, 1:] - centre)])


def end_vertices(points: Array, triangles: IntArray, share: float = 0.07) -> tuple[list[int], list[int]]:
    """Vertex indices in the first and the last `share` of a surface's extent in x."""
    x = points[:, 0]
    used = np.unique(triangles)
    t = (x[used] - x[used].min()) / np.ptp(x[used])
    return used[t < share].tolist(), used[t > 1.0 - share].tolist()


def write_attachments(path: Path, attachments: Mapping[str, list[int]]) -> None:
    """Write {bone: vertex ids} as JSON."""
    write_text(path, json.dumps({bone: [int(i) for i in ids] for bone, ids in attachments.items()}) + "\n")


def write_curve(path: Path, points: Array, prefix: str) -> None:
    """Write points (n, 3), RAS mm, as an open 3D Slicer markups curve."""
    control = [
        {"id": str(n + 1), "label": f"{prefix}-{n + 1}", "position": [round(float(c), 4) for c in point]}
        for n, point in enumerate(points)
    ]
    markup = {"type": "Curve", "coordinateSystem": "RAS", "coordinateUnits": "mm", "controlPoints": control}
    schema = (
        "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
        "markups-schema-v1.0.3.json#"
    )
    write_text(path, json.dumps({"@schema": schema, "markups": [markup]}, indent=1) + "\n")
