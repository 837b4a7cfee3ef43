"""Unconstrained rigid-body modes: a solve pins them, and refuses a load along them.

The energy of a body does not change in its unconstrained rigid motions, so that fixing as many degrees of
freedom as there are such motions puts no reaction on it (Wang 2021 §5.5). A constant load along one of them
has no equilibrium.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.linear.nullspace import unit_twists
from handpipe.fem.minimisation.balance import lengths, loads, vertex_parts
from handpipe.fem.potentials.potential import Potential, Sum

RESISTED = 1e-9  # of the largest stiffness: a body softer than this against translation is examined
UNFELT = 1e-8  # of the force's size: forces in equilibrium leave rounding
SAMPLES = 12  # of the noise of forces
NOISE = 1e-2  # of the body's size
FAR = 1.0  # of the scene's size: a body that moved farther than this is examined
FREE = 1e-10  # of a body's contact and spring stiffness: less against translation is rounding
SHARE = 0.1  # of a body's load: a smaller net force is not what moves it


def pins(energy: Sum, matrix: sp.csr_matrix, x: Array, free: BoolArray) -> IntArray:
    """Unknowns whose fixing stops every rigid motion of x (n, 3) without resistance, and no deformation.

    `matrix` (3n, 3n) is the Hessian at x; `free` (3n,) masks the unknowns. Each connected part of the matrix
    is examined separately. A motion has no resistance if the forces in a few shapes near x do no work in it;
    the reactions of the pins then vanish at an equilibrium (Wang 2021, Nullspace Lemma).
    """
    parts = _loose_parts(matrix, x, free)
    rows = _rows(energy.potentials, x, parts, free) if parts else []
    found = [_part_pins(r, x, v, free) for r, v in zip(rows, parts, strict=True)]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)


def unbalanced(energy: Sum, matrix: sp.csr_matrix, x: Array, free: BoolArray) -> str:
    """Constant load that no potential can ever resist, by body and direction; empty where there is none.

    A body that contact may reach is not judged here: it may still find an equilibrium.
    """
    load = loads(energy, x)
    if load is None:
        return ""
    stiff = [p for p in energy.potentials if not getattr(p, "constant", False)]
    barred = _barred(stiff, len(x))
    parts = [v for v in _loose_parts(matrix, x, free) if load[v].any() and not barred[v].any()]
    for vertices, rows in zip(parts, _rows(stiff, x, parts, free), strict=True):
        size = lengths(load[vertices]).sum()
        shifts = _nullspace(rows[:, :3])
        net = shifts @ (shifts.T @ load[vertices].sum(axis=0))
        if np.linalg.norm(net) > UNFELT * size:
            return f"nothing resists the net force {_vector(net)} mN on {described(vertices, energy)}"
    return ""


def drifting(energy: Sum, x: Array, start: Array, free: BoolArray) -> str:
    """Which body has moved far from `start` (n, 3) under a net load against which it has no stiffness.

    A fixed degree of freedom, one that is not in the mask `free` (3n,), stops its body in that direction.
    """
    load = loads(energy, x)
    if load is None:
        return ""
    extent = float(np.ptp(start, axis=0).max())
    elastic = [p for p in energy.potentials if hasattr(p, "resistance")]
    others = [p for p in energy.potentials if p not in elastic and not getattr(p, "constant", False)]
    if not elastic or not np.all(np.isfinite(x)):
        return ""
    parts = vertex_parts(Sum(elastic).hessian(x))
    total = load - Sum(others).gradient(x)
    stiffness = Sum(others).hessian(x) if others else None
    for part in np.unique(parts[lengths(load) > 0]):
        vertices = np.flatnonzero(parts == part)
        moved = (x - start)[vertices].mean(axis=0)
        if np.linalg.norm(moved) < FAR * extent:
            continue
        shifts = np.eye(3) if stiffness is None else _free_shifts(stiffness, vertices)
        movable = free.reshape(-1, 3)[vertices].all(axis=0)
        net = shifts @ (shifts.T @ np.where(movable, total[vertices].sum(axis=0), 0.0))
        if np.linalg.norm(net) > SHARE * np.linalg.norm(load[vertices].sum(axis=0)):
            body = described(vertices, energy)
            return f"{body} has moved {np.linalg.norm(moved):.3g} mm: nothing resists {_vector(net)} mN on it"
    return ""


def described(vertices: IntArray, energy: Sum) -> str:
    """A body by its vertices (k,), for messages."""
    if len(vertices) == 1:
        free = not any(p.resistance()[vertices[0]] > 0 for p in energy.potentials if hasattr(p, "resistance"))
        return f"vertex {vertices[0]}" + (", which no element has" if free else "")
    first = ", ".join(str(v) for v in vertices[:4])
    return f"the body of vertices {first}{', …' if len(vertices) > 4 else ''} ({len(vertices)} in all)"


def _vector(force: Array) -> str:
    return "(" + ", ".join(f"{c:.3g}" for c in force) + ")"


def _free_shifts(stiffness: sp.csr_matrix, vertices: IntArray) -> Array:
    """Directions (3, k) in which springs and contact (3n, 3n) do not resist a body's translation."""
    shifts = np.zeros((stiffness.shape[0] // 3, 3, 3))
    shifts[vertices] = np.eye(3)
    shifts = shifts.reshape(-1, 3)
    values, directions = np.linalg.eigh(shifts.T @ (stiffness @ shifts))
    whole = float(np.abs(stiffness.diagonal()).reshape(-1, 3)[vertices].sum())
    return np.asarray(directions[:, values <= FREE * whole])


def _barred(potentials: Sequence[Potential], count: int) -> BoolArray:
    """Vertices (n,) that contact may reach, wherever they are now."""
    mask = np.zeros(count, dtype=bool)
    for potential in potentials:
        if getattr(potential, "one_sided", False):
            mask |= potential.reached()  # type: ignore[attr-defined]
    return mask


def _loose_parts(matrix: sp.csr_matrix, x: Array, free: BoolArray) -> list[IntArray]:
    """Vertices of the connected parts whose unknowns do not resist some translation."""
    shifts = np.zeros((x.size, 3))
    for i in range(3):
        shifts[i::3, i] = free[i::3]
    forces = matrix @ shifts
    parts = vertex_parts(matrix)
    resistance = np.zeros((int(parts.max()) + 1, 3, 3))
    work = np.einsum("vki,vkj->vij", shifts.reshape(-1, 3, 3), forces.reshape(-1, 3, 3))
    np.add.at(resistance, parts, 0.5 * (work + work.transpose(0, 2, 1)))
    stiffest = float(np.abs(matrix.diagonal()).max())
    movable = np.zeros((len(resistance), 3), dtype=bool)
    np.logical_or.at(movable, parts, free.reshape(-1, 3))
    axes = np.arange(3)
    resistance[:, axes, axes] += np.where(movable, 0.0, stiffest)
    loose = movable.any(axis=1) & (np.linalg.eigvalsh(resistance)[:, 0] <= RESISTED * stiffest)
    chosen = np.flatnonzero(loose[parts])
    order = chosen[np.argsort(parts[chosen], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(parts[order])) + 1) if len(order) else []


def _rows(
    potentials: Sequence[Potential], x: Array, parts: Sequence[IntArray], free: BoolArray
) -> list[Array]:
    """For each part, conditions (r, 6) on the rigid motions without resistance.

    Each potential's forces are compared with themselves alone: those of weak springs are far smaller than
    those of the tets, which resist no rigid motion.
    """
    rng = np.random.default_rng(0)
    frames = [(float(np.ptp(x[v], axis=0).max()) or 1.0, x[v].mean(axis=0)) for v in parts]
    rows: list[list[Array]] = [[] for _ in parts]
    for _ in range(SAMPLES):
        near = x.copy()
        for vertices, (size, _) in zip(parts, frames, strict=True):
            near[vertices] += NOISE * size * rng.normal(size=(len(vertices), 3))
        for gradient in (p.gradient(near) for p in potentials):
            for vertices, (size, centre), found in zip(parts, frames, rows, strict=True):
                force = gradient[vertices].ravel()
                length = np.linalg.norm(force)
                if length > 0:
                    found.append(force @ unit_twists(near[vertices], centre, size) / length)
    for vertices, (size, centre), found in zip(parts, frames, rows, strict=True):
        fixed = ~free.reshape(-1, 3)[vertices].ravel()
        found.extend(unit_twists(x[vertices], centre, size)[fixed])
    return [np.array(found).reshape(-1, 6) for found in rows]


def _part_pins(rows: Array, x: Array, vertices: IntArray, free: BoolArray) -> IntArray:
    unfelt = _nullspace(rows)
    if unfelt.shape[1] == 0:
        return np.zeros(0, dtype=np.int64)
    size, centre = float(np.ptp(x[vertices], axis=0).max()) or 1.0, x[vertices].mean(axis=0)
    degrees = (3 * vertices[:, None] + np.arange(3)).ravel()
    motions = np.where(free[degrees][:, None], unit_twists(x[vertices], centre, size) @ unfelt, 0.0)
    pivots = scipy.linalg.qr(motions.T, mode="economic", pivoting=True)[2]
    return np.sort(degrees[pivots[: unfelt.shape[1]]])


def _nullspace(rows: Array) -> Array:
    """Null directions (d, k) of rows (r, d); the rows of an unconstrained body are rounding alone."""
    if len(rows) == 0:
        return np.eye(rows.shape[1])
    _, values, directions = np.linalg.svd(rows)
    return np.asarray(directions[int((values > UNFELT).sum()) :].T)
