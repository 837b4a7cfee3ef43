"""Plastic strains of the fat that lay the simulated skin on a scan (Zheng 2022 §7.3, Eq. 22-24).

Strains are kept as logarithms: F_p = exp(S), S symmetric (m, 6). They stay positive definite by construction,
and the smoothness term acts on S. The linearised search direction of Eq. 24 is computed in the current shape;
its strain is turned back to the rest shape by each tet's rotation before it is added, which matters as soon
as a finger bends by tens of degrees.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, ConvergenceError, RigidTransform, Shapes, vertices_of
from handpipe.fem.elements import plasticity, polar
from handpipe.fem.linear import factorise
from handpipe.fem.potentials import Potential
from handpipe.fem.solver import Limits
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh, gradient_operator, mass_lumped, tet_laplacian
from handpipe.tissues.fat.resting import LoadCase, opened, settled_from
from handpipe.tissues.fat.tissue import Tissue

log = logging.getLogger(__name__)

ON_THE_WAY = Limits(
    renewals=4, settled=0.01, gross=np.inf
)  # mm: while the search chooses between shapes, they may still creep


@dataclass(frozen=True)
class FitSettings:
    """Weights and limits of the fit of strains.

    The weights of Eq. 22 are made free of mesh size: mean squared roughness of log-strains against mean
    squared mm.

    Parameters
    ----------
    smoothness : float
        Weight in mm^2 of the strains' roughness.
    hold : float
        Weight of the constraints in the search direction, against the scan's.
    reach : float
        Distance in mm from the skin up to which the scan counts.
    rim : float
        Distance in mm from the scan's boundary up to which the scan is not used.
    iterations : int
        Largest number of iterations.
    least_gain : float
        Relative decrease of the objective under which the fit has converged.
    least_step : float
        Smallest step of the line search.
    largest_change : float
        Largest change of a tet's log-strain (Frobenius norm) in one iteration.

    References
    ----------
    Zheng 2022 §7.3, Eq. 22.
    """

    smoothness: float = 0.02
    hold: float = 10.0
    reach: float = 6.0
    rim: float = 1.0
    iterations: int = 30
    least_gain: float = 0.02
    least_step: float = 0.1
    largest_change: float = 0.5


@dataclass
class ScanTarget:
    """A scan to match; area (n,) in mm^2 is each skin vertex's share, zero where unused."""

    scan: Surface
    area: Array
    settings: FitSettings
    _distance: Distance = field(init=False)
    _rim: cKDTree | None = field(init=False)

    def __post_init__(self) -> None:
        """Builds the distance to the scan, and the search tree of its boundary vertices."""
        self._distance = Distance(self.scan)
        rim = np.unique(self.scan.boundary_edges())
        self._rim = cKDTree(self.scan.vertices[rim]) if len(rim) else None

    def match(self, skin: Surface) -> tuple[Array, Array, Array]:
        """Signed gaps (n,) from the scan to the skin, the scan's normals (n, 3), and weights (n,)."""
        gaps, _, closest, normals = self._distance.signed(skin.vertices)
        agree = np.einsum("ni,ni->n", normals, skin.vertex_normals()) > 0.5
        known = agree & (np.abs(gaps) < self.settings.reach)
        if self._rim is not None:
            known &= self._rim.query(closest)[0] > self.settings.rim
        offsets = np.einsum("ni,ni->n", skin.vertices - closest, normals)
        weights = self.area * known
        return offsets, normals, weights / weights.sum()


@dataclass(frozen=True)
class FatState:
    """Log-strains, their equilibrium, the gaps from the scan to the skin there, and the solver's figures."""

    logs: Array
    x: Array
    offsets: Array
    normals: Array
    weights: Array
    value: float
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def mean_gap(self) -> float:
        """Mean distance in mm from the scan to the skin."""
        return float(self.weights @ np.abs(self.offsets))

    def row(self, step: float) -> dict[str, float]:
        """Figures for the record."""
        return {
            "objective": self.value,
            "mean_gap": self.mean_gap,
            "max_gap": float(np.abs(self.offsets[self.weights > 0]).max()),
            "step": step,
        }


@dataclass
class FatFit:
    """Strains of the fat in one pose, and how they were found.

    Parameters
    ----------
    log_strains : array (m, 6)
        Logarithms of the plastic strains.
    vertices : array (n, 3)
        Vertices at equilibrium in mm.
    record : list of dict of str to float
        A row for each iteration: objective, mean and largest gap in mm, step.
    figures : dict of str to float
        Whether the equilibrium is valid and settled, by name, as in the figures of a frame's fat; the mean
        gap in mm at the end; and `unfinished`, 1 where the fit ended without having converged.
    """

    log_strains: Array
    vertices: Array
    record: list[dict[str, float]]
    figures: dict[str, float]


def strain_operator(mesh: TetMesh, x: Array) -> sparse.csr_matrix:
    """Strain increments (6 m) in the rest frame per displacement (3 n) from x: sym(R^T grad(dx) R)."""
    rotations, _ = polar((gradient_operator(mesh.vertices, mesh.tets) @ x.ravel()).reshape(-1, 3, 3))
    r = rotations
    rows = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    blocks = np.stack(
        [
            0.5
            * (
                np.einsum("mi,mj->mij", r[:, :, a], r[:, :, b])
                + np.einsum("mj,mi->mij", r[:, :, a], r[:, :, b])
            )
            for a, b in rows
        ],
        axis=1,
    ).reshape(-1, 6, 9)
    m = len(mesh.tets)
    block = sparse.bsr_matrix((blocks, np.arange(m), np.arange(m + 1)), shape=(6 * m, 9 * m))
    return (block.tocsr() @ gradient_operator(x, mesh.tets)).tocsr()


def fit_strains(
    tissue: Tissue,
    below: Mapping[str, Shapes],
    rigid: Mapping[str, RigidTransform],
    scan: Surface,
    start: Array,
    settings: FitSettings,
    name: str = "strains of the fat",
) -> FatFit:
    """Log-strains that bring the skin at equilibrium in a frame onto the scan.

    Rigid parts of the skin are not pulled.

    Parameters
    ----------
    tissue : Tissue
        The tissue, m tets and n vertices.
    below : mapping of str to Shapes
        Shapes of the layers below in the frame.
    rigid : mapping of str to RigidTransform
        Transform from neutral of each rigid part of the skin.
    scan : Surface
        Scan in mm, in the frame of the simulation.
    start : array (n, 3)
        Initial guess of the vertices in mm.
    settings : FitSettings
        Weights and limits.
    name : str
        What errors call this fit.

    Returns
    -------
    FatFit
        Strains, vertices, a row for each iteration, and figures. The figures tell whether contact has
        settled and whether the fit has converged.

    Raises
    ------
    ConvergenceError
        Where the equilibrium without strains fails, or tets are inverted at the end.

    References
    ----------
    Zheng 2022 §7.3, Eq. 22-23.
    """
    mesh, skin, case = tissue.mesh, tissue.skin, LoadCase.of(tissue, below, rigid)
    area = mass_lumped(skin.vertices, skin.triangles)
    for part in tissue.rigid.values():
        area[part.vertices] = 0.0
    target = ScanTarget(scan, area, settings)
    laplacian = sparse.kron(tet_laplacian(mesh.tets), sparse.identity(6), format="csr")
    m = len(mesh.tets)

    def state(logs: Array, guess: Array) -> FatState:
        settled = settled_from(case.with_strains(plasticity.exp(logs)), guess, ON_THE_WAY)
        x = settled.x
        offsets, normals, weights = target.match(skin.moved(tissue.skin_matrix @ x))
        rough = laplacian @ logs.ravel()
        value = settings.smoothness * rough @ rough / m + weights @ offsets**2
        return FatState(logs, x, offsets, normals, weights, float(value), settled.validity)

    now = state(np.zeros((m, 6)), opened(case, start))
    record = [now.row(0.0)]
    converged = False
    while not converged and len(record) <= settings.iterations:
        strain = strain_operator(mesh, now.x)
        constraints = case.constraints(now.x)
        step = _direction(strain, laplacian, now, tissue.skin_operator, constraints, settings)
        change = _bounded((strain @ step.ravel()).reshape(-1, 6), settings.largest_change)
        found, eta = _search(state, now, change, step, settings)
        if found is None:
            log.info("no step lowers the objective")
            break
        gain, now = 1 - found.value / now.value, found
        record.append(now.row(eta))
        log.info(
            "iteration %d: objective %.4g, mean gap %.3f mm, largest %.3f mm, step %.2f",
            len(record) - 1,
            *record[-1].values(),
        )
        converged = gain < settings.least_gain
    validity = tissue.validity(now.x)
    validity.require(name, vertices_of(below.get("bones", {})))
    ended = {"mean_gap": now.mean_gap, "unfinished": float(not converged)}
    return FatFit(now.logs, now.x, record, validity.figures | dict(now.figures) | ended)


def _bounded(change: Array, largest: float) -> Array:
    """Log-strains (m, 6), limited where they are large: there the linearisation does not hold.

    Where a thin layer is a multiple of its thickness away from the scan, it would ask for strains of several
    hundred per cent, which neighbouring poses would then interpolate.
    """
    norms = np.linalg.norm(plasticity.to_matrices(change), axis=(1, 2))
    return change * np.minimum(1.0, largest / np.maximum(norms, 1e-12))[:, None]


def _search(
    state: Callable[[Array, Array], FatState],
    now: FatState,
    change: Array,
    step: Array,
    settings: FitSettings,
) -> tuple[FatState | None, float]:
    """Halve the step until the true objective falls, its equilibrium started at the predicted shape."""
    eta = 1.0
    while eta >= settings.least_step:
        try:
            found = state(now.logs + eta * change, now.x + eta * step)
            if found.value < now.value:
                return found, eta
        except ConvergenceError as error:
            log.info("step %.2f: %s", eta, error)
        eta *= 0.5
    return None, 0.0


def _direction(
    strain: sparse.csr_matrix,
    laplacian: sparse.csr_matrix,
    now: FatState,
    skin: sparse.csr_matrix,
    constraints: Sequence[Potential],
    settings: FitSettings,
) -> Array:
    """The displacement (n, 3) that minimises the linearised objective (Eq. 24) and the constraints' springs.

    skin (3 k, 3 n): flattened skin positions from the tissue's. Without the springs the direction would move
    constrained vertices, and the line search would need shorter steps.
    """
    n, m, k = len(now.x), len(now.logs), len(now.offsets)
    rough = laplacian @ strain
    spread = sparse.csr_matrix(
        (now.normals.ravel(), np.arange(3 * k), 3 * np.arange(k + 1)), shape=(k, 3 * k)
    )
    gap = (spread @ skin).tocsr()
    springs = sum((p.hessian(now.x) for p in constraints[1:]), start=constraints[0].hessian(now.x))
    springs = springs * (settings.hold / springs.diagonal().sum())
    share = settings.smoothness / m
    matrix = share * (rough.T @ rough) + gap.T @ sparse.diags(now.weights) @ gap + springs
    matrix = matrix + sparse.identity(3 * n) * (1e-9 * matrix.diagonal().mean())
    right = -share * (rough.T @ (laplacian @ now.logs.ravel())) - gap.T @ (now.weights * now.offsets)
    return factorise(matrix.tocsr(), positive=True).solve(right).reshape(n, 3)
