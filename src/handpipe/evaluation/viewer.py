"""Data of the report's 3D view: decimated surfaces in a few frames, positions as 16-bit integers."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, IntArray, Shape
from handpipe.evaluation.pictures import body_surface
from handpipe.hand import SimulatedFrame, colour, opacity, shown, tissue
from handpipe.mesh.surfaces import Distance

STEPS = 65535  # of a 16-bit coordinate
TRIANGLES = 3000  # of one body in the view


def view_data(frames: Sequence[SimulatedFrame], triangles: int = TRIANGLES) -> dict[str, Any]:
    """Data that the view's script reads, ready for JSON, without bodies that some frame lacks.

    `low` (3,) and `scale` in mm give a coordinate as low + scale * integer; each body has `triangles`
    (uint32) and `positions` (uint16, frame by frame, four a vertex) in base64.
    """
    series = _series(frames)
    moving = {key: _decimated(shapes, triangles) for key, shapes in series.items()}
    every = np.concatenate([x.reshape(-1, 3) for _, x in moving.values()]) if moving else np.zeros((1, 3))
    low = every.min(axis=0)
    scale = max(float((every.max(axis=0) - low).max()), 1e-9) / STEPS
    bodies = []
    for (layer, body), (faces, positions) in moving.items():
        look = tissue(layer, body)
        integers = np.zeros((*positions.shape[:2], 4), np.uint16)  # padded: attributes start at 4-byte steps
        integers[..., :3] = np.round((positions - low) / scale)
        bodies.append(
            {
                "name": body,
                "layer": look.replace("_", " "),
                "colour": colour(look),
                "opacity": opacity(look),
                "count": positions.shape[1],
                "triangles": _base64(faces.astype("<u4")),
                "positions": _base64(integers.astype("<u2")),
            }
        )
    return {
        "frames": [frame.name for frame, _ in frames],
        "low": low.tolist(),
        "scale": scale,
        "bodies": bodies,
    }


def _series(frames: Sequence[SimulatedFrame]) -> Mapping[tuple[str, str], list[Shape]]:
    series: dict[tuple[str, str], list[Shape]] = {}
    for _, layers in frames:
        for layer, body, shape in shown(layers):
            series.setdefault((layer, body), []).append(shape)
    return {key: shapes for key, shapes in series.items() if len(shapes) == len(frames)}


def _decimated(shapes: Sequence[Shape], target: int) -> tuple[IntArray, Array]:
    """Triangles (k, 3) and positions (f, n, 3) of a body's coarse surface.

    The surface is decimated in the first frame. Its vertices follow the closest fine triangles in the others.
    """
    surfaces = [body_surface(shape) for shape in shapes]
    first = surfaces[0]
    if len(first.triangles) <= target:
        return first.triangles, np.stack([s.vertices for s in surfaces])
    points, faces = fast_simplification.simplify(
        first.vertices.astype(np.float32), first.triangles.astype(np.int32), target_count=target
    )
    _, feet, closest = Distance(first).closest(points.astype(float))
    weights = _barycentric(closest, first.vertices[first.triangles[feet]])
    carried = [np.einsum("ni,nij->nj", weights, s.vertices[s.triangles[feet]]) for s in surfaces]
    return faces.astype(np.int64), np.stack(carried)


def _barycentric(points: Array, corners: Array) -> Array:
    """Weights (n, 3) of points (n, 3) in the planes of triangles (n, 3, 3)."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    wu, wv = (w * u).sum(1), (w * v).sum(1)
    area = np.maximum(uu * vv - uv**2, 1e-300)
    s, t = (vv * wu - uv * wv) / area, (uu * wv - uv * wu) / area
    return np.column_stack([1 - s - t, s, t])


def _base64(array: NDArray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
