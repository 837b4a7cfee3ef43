"""Stage 2: surfaces of one pose pushed apart until no muscle is inside another or inside a bone (000 section
4.4).
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from handpipe import artifacts
from handpipe.errors import ConvergenceError
from handpipe.mesh.barycentric import barycentric_weights
from handpipe.mesh.distance import Distance
from handpipe.mesh.operators import cotangent_laplacian, mass_lumped
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

log = logging.getLogger(__name__)

KIND = "separated-muscles"
STRIDE = 0.5  # mm that a vertex moves in one step at most
DAMPED = 20  # steps after which they are halved
FLAT = 0.7  # cosine between a face's normal and the interpolated one; at sharper edges that says nothing


@dataclass(frozen=True)
class SeparationOptions:
    """reach: mm over which a displacement fades along the surface; clearance: mm kept between surfaces;
    tolerance: mm of penetration that ends the search; acceptable: mm that the best of all steps may leave;
    volume: relative change of a muscle's volume at most."""

    reach: float = 3.0
    clearance: float = 0.02
    tolerance: float = 0.02
    acceptable: float = 0.05
    volume: float = 0.008
    iterations: int = 100


@dataclass(frozen=True)
class Separation:
    """Separated surfaces by name; penetration in mm before and after; iterations."""

    surfaces: dict[str, Surface]
    penetration_before: float
    penetration: float
    iterations: int

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the surfaces as an artifact."""
        data = {n: {"vertices": s.vertices, "triangles": s.triangles} for n, s in self.surfaces.items()}
        artifacts.write(path, data, kind=KIND, units={f"{n}/vertices": "mm" for n in data}, inputs=inputs)


def load_surfaces(path: str | Path) -> dict[str, Surface]:
    """The surfaces that `Separation.save` wrote, by muscle."""
    return {n: Surface(s["vertices"], s["triangles"]) for n, s in artifacts.read(path, KIND).items()}


def separate(
    muscles: Mapping[str, Surface],
    fixed: Mapping[str, Surface],
    options: SeparationOptions | None = None,
    *,
    held: Mapping[str, IntArray] | None = None,
) -> Separation:
    """Push overlapping closed surfaces apart, both muscles of a pair alike; `fixed` bodies stay.

    The displacement u minimises thin-plate bending and size, reach^4 |lap u|^2 + |u|^2 integrated over the
    surfaces, under a stiff one-sided penalty at vertices, edge midpoints and triangle centres that lie inside
    another body. Where nothing is penetrated u is zero and stays zero. held: vertex ids of each muscle that
    do not move and do not collide (attachments). Raises `ConvergenceError` where penetration remains.
    """
    options = options or SeparationOptions()
    bodies = [_Body(s, options.reach, (held or {}).get(name)) for name, s in muscles.items()]
    names = list(muscles)
    starts = np.cumsum([0, *(len(b.surface.vertices) for b in bodies)])
    x0 = np.concatenate([b.surface.vertices for b in bodies])
    stiffness = sparse.block_diag([b.stiffness for b in bodies], format="csr")
    mass = float(np.median(np.concatenate([b.mass for b in bodies])))
    parts = [slice(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True)]
    x, before, depth = x0.copy(), 0.0, 0.0
    best: Separation | None = None
    for iteration in range(options.iterations):
        contacts = _contacts(bodies, parts, x, fixed, options.clearance)
        depth = max(0.0, float(-(contacts.gaps + options.clearance).min(initial=0.0)))
        volumes = _volume_rows(bodies, parts, x, options.volume)
        before = depth if iteration == 0 else before
        if not volumes and (best is None or depth < best.penetration):
            surfaces = {n: b.surface.moved(x[p]) for n, b, p in zip(names, bodies, parts, strict=True)}
            best = Separation(surfaces, before, depth, iteration)
        if best is not None and best.penetration <= options.tolerance:
            return best
        penalty = mass * min(
            10.0 * 1.4**iteration, 1e6
        )  # soft at first: deep overlaps contradict one another
        step = _step(x, x0, stiffness, mass, penalty, contacts, volumes)
        # Between thin bodies the set of touching points may alternate; half steps end that.
        share = 1.0 if iteration < DAMPED else 0.5
        x = x + step * min(share, STRIDE / max(float(np.linalg.norm(step, axis=1).max()), 1e-9))
        log.info("separation %d: penetration %.3f mm at %d points", iteration, depth, len(contacts.gaps))
    if best is not None and best.penetration <= options.acceptable:
        log.info("separation: the best of all steps leaves %.3f mm", best.penetration)
        return best
    raise ConvergenceError(
        "Separation of muscles",
        f"{depth:.3f} mm of penetration and volumes changed by up to "
        f"{100 * _largest_change(bodies, parts, x):.1f} % after {options.iterations} steps",
    )


class _Body:
    def __init__(self, surface: Surface, reach: float, held: IntArray | None) -> None:
        self.surface, self.volume = surface, surface.volume()
        self.mass = mass_lumped(surface.vertices, surface.triangles)
        laplacian = cotangent_laplacian(surface.vertices, surface.triangles)
        bending = laplacian @ sparse.diags(1 / self.mass) @ laplacian
        hold = np.zeros(len(self.mass))
        hold[[] if held is None else held] = 1e6
        self.stiffness = reach**4 * bending + sparse.diags(self.mass * (1 + hold))
        self.samples = _sampling(surface, hold > 0)


def _sampling(surface: Surface, held: NDArray[np.bool_]) -> sparse.csr_matrix:
    """Matrix (s, n) that takes vertices to vertices, edge midpoints and triangle centres, without held
    vertices.
    """
    n, edges, triangles = len(surface.vertices), surface.edges(), surface.triangles
    free = np.flatnonzero(~held)
    edges, triangles = edges[~held[edges].any(axis=1)], triangles[~held[triangles].any(axis=1)]
    parts = [_average(cells, n) for cells in (free[:, None], edges, triangles)]
    return sparse.vstack(parts, format="csr")


def _average(cells: IntArray, n: int) -> sparse.csr_matrix:
    k, size = cells.shape
    return sparse.csr_matrix(
        (np.full(k * size, 1 / size), cells.ravel(), size * np.arange(k + 1)), shape=(k, n)
    )


@dataclass(frozen=True)
class _Contacts:
    """Gaps (c,) less the clearance, their gradients (c, 3 N), and the points' weights of vertices (c, N)."""

    gaps: Array
    rows: sparse.csr_matrix
    points: sparse.csr_matrix


def _contacts(
    bodies: Sequence[_Body], parts: Sequence[slice], x: Array, fixed: Mapping[str, Surface], clearance: float
) -> _Contacts:
    """Points inside another body, each to be moved along its closest point's interpolated normal.

    With the triangle's own normal a point in a dimple of few triangles swings between them for ever.
    """
    gaps, rows, own_rows = [np.zeros(0)], [sparse.csr_matrix((0, x.size))], [sparse.csr_matrix((0, len(x)))]
    moved = [b.surface.moved(x[p]) for b, p in zip(bodies, parts, strict=True)]
    for i, (body, part) in enumerate(zip(bodies, parts, strict=True)):
        points = body.samples @ x[part]
        others = [(j, s) for j, s in enumerate(moved) if j != i] + [(-1, s) for s in fixed.values()]
        for j, other in others:
            near = _near(points, other, clearance)
            gap, triangles, closest, normals = Distance(other).signed(points[near])
            inside = gap < clearance
            near = near[inside]
            own = _shift(body.samples[near], part.start, len(x))
            own_rows.append(own)
            corners = other.triangles[triangles[inside]]
            weights = barycentric_weights(closest[inside], other.vertices[corners])
            smooth = np.einsum("ka,kai->ki", weights, other.vertex_normals()[corners])
            smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
            flat = np.einsum("ki,ki->k", smooth, normals[inside]) > FLAT
            directions = np.where(flat[:, None], smooth, normals[inside])
            if j >= 0:
                own = own - _scattered(weights, corners + parts[j].start, len(x))
            gaps.append(gap[inside] - clearance)
            rows.append(_along(own, directions))
    stacked = sparse.vstack(rows, format="csr"), sparse.vstack(own_rows, format="csr")
    return _Contacts(np.concatenate(gaps), *stacked)


def _near(points: Array, other: Surface, margin: float) -> IntArray:
    low, high = other.vertices.min(axis=0) - margin, other.vertices.max(axis=0) + margin
    return np.flatnonzero(((points > low) & (points < high)).all(axis=1))


def _shift(matrix: sparse.csr_matrix, start: int, total: int) -> sparse.csr_matrix:
    return sparse.csr_matrix(
        (matrix.data, matrix.indices + start, matrix.indptr), shape=(matrix.shape[0], total)
    )


def _scattered(weights: Array, corners: IntArray, total: int) -> sparse.csr_matrix:
    """Rows (k, total) of weights (k, 3) at corners (k, 3)."""
    k = len(corners)
    return sparse.csr_matrix((weights.ravel(), corners.ravel(), 3 * np.arange(k + 1)), shape=(k, total))


def _along(weights: sparse.csr_matrix, normals: Array) -> sparse.csr_matrix:
    """Rows (c, 3 N): a point's weights (c, N) times the direction (c, 3) in which it is measured."""
    w = sparse.coo_matrix(weights)
    indices = (3 * w.col[:, None] + np.arange(3)).ravel()
    data = (w.data[:, None] * normals[w.row]).ravel()
    return sparse.csr_matrix((data, (np.repeat(w.row, 3), indices)), shape=(w.shape[0], 3 * w.shape[1]))


def _volume_rows(
    bodies: Sequence[_Body], parts: Sequence[slice], x: Array, tolerance: float
) -> list[tuple[Array, float]]:
    """Gradient (3 N,) and wanted change of each volume that has left its band."""
    rows = []
    for body, part in zip(bodies, parts, strict=True):
        surface = body.surface.moved(x[part])
        change = surface.volume() / body.volume - 1
        if abs(change) > tolerance:
            gradient = np.zeros_like(x)
            gradient[part] = volume_gradient(surface)
            rows.append((gradient.ravel(), body.volume * (0.9 * np.sign(change) * tolerance - change)))
    return rows


def _largest_change(bodies: Sequence[_Body], parts: Sequence[slice], x: Array) -> float:
    """Relative change of the volume that changed most."""
    return max(abs(b.surface.moved(x[p]).volume() / b.volume - 1) for b, p in zip(bodies, parts, strict=True))


def volume_gradient(surface: Surface) -> Array:
    """Derivative (n, 3) of the enclosed volume by the vertices."""
    gradient = np.zeros_like(surface.vertices)
    points = surface.vertices[surface.triangles]
    for corner in range(3):
        opposite = np.cross(points[:, (corner + 1) % 3], points[:, (corner + 2) % 3]) / 6
        np.add.at(gradient, surface.triangles[:, corner], opposite)
    return gradient


def _step(
    x: Array,
    x0: Array,
    stiffness: sparse.csr_matrix,
    damping: float,
    penalty: float,
    contacts: _Contacts,
    volumes: Sequence[tuple[Array, float]],
) -> Array:
    """Damped step (N, 3) to the minimiser with contacts linearised at x; volumes by Lagrange multipliers."""
    full = sparse.kron(stiffness, sparse.eye(3), format="csr")
    still = sparse.kron(
        contacts.points.T @ contacts.points, sparse.eye(3), format="csr"
    )  # do not slip sideways
    matrix = (
        full + damping * sparse.identity(x.size) + penalty * (contacts.rows.T @ contacts.rows + 0.1 * still)
    )
    factor = splu(matrix.tocsc())
    force = -(full @ (x - x0).ravel()) - penalty * contacts.rows.T @ contacts.gaps
    step = factor.solve(force)
    if volumes:
        rows = np.array([row for row, _ in volumes])
        missing = np.array([change for _, change in volumes]) - rows @ step
        influence = factor.solve(rows.T)
        step = step + influence @ np.linalg.solve(rows @ influence, missing)
    return step.reshape(-1, 3)
