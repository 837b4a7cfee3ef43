"""Data of the report's 3D view: decimated surfaces in every frame, positions as 16-bit integers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, IntArray, Shape, evenly
from handpipe.evaluation.pictures import body_surface, surface_colours
from handpipe.evaluation.sides import view_directions
from handpipe.hand import SimulatedFrame, colour, opacity, surfaces_once, tissue
from handpipe.mesh.surfaces import Distance
from handpipe.skeleton.rig import HandDirections

STEPS = 65535  # of a 16-bit coordinate
TRIANGLES = 2500  # of one body in the view
SKIN = 4  # times as many triangles of the skin
BYTES = 24_000_000  # of the positions of a scene; of longer ones evenly chosen frames are shown
DIGITS = 5  # of a direction
SHEETS = "fascia"  # layers so named cover others: the view begins without them


@dataclass(frozen=True)
class _Coarse:
    """Triangles (k, 3), positions (f, n, 3) in each frame and, of a body of several, colours (n, 3)."""

    faces: IntArray
    positions: Array
    rgb: Array | None


def view_data(
    frames: Sequence[SimulatedFrame],
    directions: HandDirections | None = None,
    *,
    triangles: int = TRIANGLES,
    size: int = BYTES,
) -> dict[str, Any]:
    """Data of a scene that the view's script reads, ready for JSON.

    Bodies that some frame lacks are left out, and so are volume meshes and centrelines of a body whose
    surface is there.

    Parameters
    ----------
    frames : sequence of SimulatedFrame
        Frames of the scene with their shapes.
    directions : HandDirections, optional
        Directions of the hand in neutral; without them the view has no buttons for its sides.
    triangles : int
        Triangles of a body, at most; the skin has more.
    size : int
        Bytes of all positions, at most, as far as two frames allow.

    Returns
    -------
    dict
        `frames`, names; `total`, how many frames the scene has; `low` (3,) and `scale` in mm, which give a
        coordinate as low + scale * integer; `views`, by name and frame six numbers, the direction to the
        camera and that upwards; `hidden`, layers that are not shown at first; `bodies` with `name`, `layer`,
        `colour`, `colours` (uint8, three a vertex, of a body of several), `opacity`, `triangles` (uint32) and
        `positions` (uint16, frame by frame, three a vertex) in base64.
    """
    # The first and last frame tell how large the bodies are before all frames are carried along.
    ends = _carried([frames[0], frames[-1]], triangles) if frames else {}
    per_frame = sum(2 * 3 * coarse.positions.shape[1] for coarse in ends.values())
    chosen = evenly(len(frames), max(size // max(per_frame, 1), 2))
    picked = [frames[i] for i in chosen]
    moving = _carried(picked, triangles)
    every = (
        np.concatenate([c.positions.reshape(-1, 3) for c in moving.values()]) if moving else np.zeros((1, 3))
    )
    low = every.min(axis=0)
    scale = max(float((every.max(axis=0) - low).max()), 1e-9) / STEPS
    return {
        "frames": [frame.name for frame, _ in picked],
        "total": len(frames),
        "low": low.tolist(),
        "scale": scale,
        "views": _views(picked, directions),
        "hidden": sorted({look for key in moving if (look := _layer(*key)).endswith(SHEETS)}),
        "bodies": [
            _body(*key, coarse.faces, np.round((coarse.positions - low) / scale), coarse.rgb)
            for key, coarse in moving.items()
        ],
    }


def _views(
    frames: Sequence[SimulatedFrame], directions: HandDirections | None
) -> dict[str, list[list[float]]]:
    if directions is None:
        return {}
    found: dict[str, list[list[float]]] = {}
    for frame, _ in frames:
        for view, pair in view_directions(directions.moved(frame.bones)).items():
            found.setdefault(view, []).append(np.round(np.concatenate(pair), DIGITS).tolist())
    return found


def _body(layer: str, body: str, faces: IntArray, integers: Array, rgb: Array | None) -> dict[str, Any]:
    look = tissue(layer, body)
    colours = {} if rgb is None else {"colours": _base64(np.round(255 * rgb).astype("u1"))}
    return colours | {
        "name": body,
        "layer": _layer(layer, body),
        "colour": colour(look),
        "opacity": opacity(look),
        "triangles": _base64(faces.astype("<u4")),
        "positions": _base64(integers.astype("<u2")),
    }


def _layer(layer: str, body: str) -> str:
    """Name of a body's layer, for people."""
    return tissue(layer, body).replace("_", " ")


def _carried(frames: Sequence[SimulatedFrame], triangles: int) -> dict[tuple[str, str], _Coarse]:
    """The coarse surface of each body that all frames have."""
    series: dict[tuple[str, str], list[Shape]] = {}
    for _, layers in frames:
        for layer, body, shape in surfaces_once(layers):
            series.setdefault((layer, body), []).append(shape)
    return {
        key: _decimated(tissue(*key), shapes, triangles * (SKIN if tissue(*key) == "skin" else 1))
        for key, shapes in series.items()
        if len(shapes) == len(frames)
    }


def _decimated(look: str, shapes: Sequence[Shape], target: int) -> _Coarse:
    """A body's coarse surface.

    The surface is decimated in the first frame. Its vertices follow the closest fine triangles in the others.
    """
    surfaces = [body_surface(shape) for shape in shapes]
    first, rgb = surfaces[0], surface_colours(look, shapes[0])
    if len(first.triangles) <= target:
        return _Coarse(first.triangles, np.stack([s.vertices for s in surfaces]), rgb)
    points, faces = fast_simplification.simplify(
        first.vertices.astype(np.float32), first.triangles.astype(np.int32), target_count=target
    )
    _, feet, closest = Distance(first).closest(points.astype(float))
    corners = first.triangles[feet]
    weights = _barycentric(closest, first.vertices[corners])
    carried = [np.einsum("ni,nij->nj", weights, s.vertices[s.triangles[feet]]) for s in surfaces]
    blended = None if rgb is None else np.clip(np.einsum("ni,nij->nj", weights, rgb[corners]), 0, 1)
    return _Coarse(faces.astype(np.int64), np.stack(carried), blended)


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
