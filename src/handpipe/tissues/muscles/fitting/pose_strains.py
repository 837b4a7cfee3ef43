"""Stage 3: plastic strains that reproduce the example shapes and change smoothly with the pose.

Minimises, over the mesh vertices x_i of each example pose i (Zheng 2022 Eq. 3),

    sum_i |L S(x_i)|^2 + alpha |W x_i - y_i|^2 + gamma sum_i |sum_j Lpose_ij S(x_j)|^2,

S the logarithm of the stretch of each tet against neutral, y_i the surface of stage 2 and Lpose the graph
Laplacian of the poses; neutral is one of its nodes, with S = 0. Given the other poses, the last term pulls
S(x_k) towards one field, so that a block of the block-coordinate descent is gamma a_k |S(x_k) - c_k|^2 and
each Gauss-Newton step is one solve with a matrix that stays the same over the sweeps.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.fem.elements import Validity, plasticity
from handpipe.fem.linear import Factor, factorise
from handpipe.mesh.tets import TetMesh, tet_laplacian
from handpipe.shapes.strains import COUNTS, StretchField

log = logging.getLogger(__name__)
COINCIDENT = 1e-3  # rad: poses nearer to one another weigh alike
ALONE = 1.05  # times the largest distance of poses alone, which is allowed at least
SHORTEST, ARMIJO = 1e-3, 0.1  # share of a step, and of the predicted decrease that it must bring
CONVERGED = 1e-4  # relative decrease below which an iteration ends


@dataclass(frozen=True)
class StrainOptions:
    """Weights and limits of the fit of plastic strains.

    Parameters
    ----------
    alpha : float
        Weight in 1/mm^2 of the surface against spatial smoothness, for a surface vertex.
    attached : float
        The same, in 1/mm^2, for attached vertices, whose places are known, and for those that touch a
        neighbour, into which they would be moved.
    largest : float
        Distance in mm between surfaces that pose smoothness may cost.
    sweeps : int
        Sweeps over all poses for each gamma.
    bisections : int
        Bisections of gamma's logarithm.
    gammas : pair of float
        Least and greatest gamma.
    steps : int
        Gauss-Newton steps of a pose without the others, at most.
    """

    alpha: float = 10.0
    attached: float = 1000.0
    largest: float = 0.5
    sweeps: int = 6
    bisections: int = 4
    gammas: tuple[float, float] = (1e-4, 1e2)
    steps: int = 30


@dataclass(frozen=True)
class KnownShape:
    """A muscle in one example pose.

    surface (v, 3): the points that the embedding carries, the same ones in each pose; start (n, 3): mesh
    vertices to begin with; touching (k,): surface vertices that touch a neighbour.
    """

    surface: Array
    start: Array
    touching: IntArray = field(default_factory=lambda: np.empty(0, np.int64))


@dataclass
class PoseStrains:
    """Plastic strains of a muscle in its N example poses.

    Attributes
    ----------
    vertices : (N, n, 3)
        Mesh vertices in the poses.
    strains : (N, m, 6)
        Plastic strains in the poses.
    gamma : float
        Weight of pose smoothness.
    distances : (N,)
        Largest distance in mm to the given surfaces.
    eigenvalues : pair of float
        Least and greatest of all strains.
    objectives : list of float
        Objective after each sweep.
    """

    vertices: Array
    strains: Array
    gamma: float
    distances: Array
    eigenvalues: tuple[float, float]
    objectives: list[float] = field(default_factory=list)

    @staticmethod
    def unknown(mesh: TetMesh) -> PoseStrains:
        """Of no example pose."""
        vertices, strains = np.zeros((0, *mesh.vertices.shape)), np.zeros((0, len(mesh.tets), 6))
        return PoseStrains(vertices, strains, 0.0, np.zeros(0), (1.0, 1.0))


def pose_laplacian(poses: Array) -> Array:
    """Laplacian (N, N) of the complete graph of pose vectors (N, d) (Wang 2021 §6.1.4).

    Each row is a pose less the mean of the others, weighted by inverse distance.
    """
    distances = np.linalg.norm(poses[:, None] - poses[None], axis=2)
    nearness = 1 / np.maximum(distances, COINCIDENT)
    np.fill_diagonal(nearness, 0.0)
    return np.eye(len(poses)) - nearness / nearness.sum(axis=1, keepdims=True)


def fit_pose_strains(
    rest: TetMesh,
    embedding: sparse.csr_matrix,
    shapes: Sequence[KnownShape],
    poses: Array,
    attached: IntArray | None = None,
    options: StrainOptions | None = None,
) -> PoseStrains:
    """Plastic strains of a muscle in its example poses.

    Parameters
    ----------
    rest : TetMesh
        Neutral mesh, n vertices in mm.
    embedding : sparse matrix (v, n)
        Matrix that carries the muscle's surface.
    shapes : sequence of KnownShape
        Shapes in the N example poses.
    poses : array (N, d)
        Pose vectors in rad, neutral at the origin.
    attached : array (t,), optional
        Ids of attached surface vertices, which are exact in the surfaces.
    options : StrainOptions, optional
        Weights and limits.

    Returns
    -------
    PoseStrains
        Strains and vertices of each pose.

    Raises
    ------
    ConvergenceError
        Where a tet stays inverted.
    """
    options = options or StrainOptions()
    weights = np.full((len(shapes), embedding.shape[0]), options.alpha)
    weights[:, [] if attached is None else attached] = options.attached
    for own, shape in zip(weights, shapes, strict=True):
        own[shape.touching] = options.attached
    space = pose_laplacian(np.vstack([np.zeros(poses.shape[1]), poses]))
    stretch, laplacian = StretchField(rest), tet_laplacian(rest.tets)
    blocks = [
        _Block(stretch, laplacian, embedding, own, shape.surface)
        for own, shape in zip(weights, shapes, strict=True)
    ]
    x = [b.alone(shape.start, options.steps) for b, shape in zip(blocks, shapes, strict=True)]
    descent = _Descent(blocks, space, options)
    alone = descent.largest(x)
    log.info("poses alone: largest distance %.3f mm", alone.max())
    allowed = max(options.largest, ALONE * alone.max())
    x, gamma, objectives = descent.with_largest_gamma(x, allowed)
    vertices = np.stack(x)
    return _result(rest, stretch, vertices, gamma, descent.largest(x), objectives)


def _result(
    rest: TetMesh, stretch: StretchField, x: Array, gamma: float, distances: Array, objectives: list[float]
) -> PoseStrains:
    for number, v in enumerate(x, start=1):
        Validity.check(rest.vertices, rest.tets, v).require(f"Strains of example {number} of {len(x)}")
    strains = np.stack([plasticity.exp(stretch(v)) for v in x])
    values = plasticity.eigenvalues(strains.reshape(-1, 6))
    bounds = float(values.min()), float(values.max())
    log.info(
        "strains: gamma %.3g, eigenvalues %.2f to %.2f, largest distance %.3f mm",
        gamma,
        *bounds,
        distances.max(),
    )
    return PoseStrains(x, strains, gamma, distances, bounds, objectives)


class _Block:
    """One pose: its part of the objective by residuals, and the normal matrices of their linearisation."""

    def __init__(
        self,
        stretch: StretchField,
        laplacian: sparse.csr_matrix,
        embedding: sparse.csr_matrix,
        weights: Array,
        target: Array,
    ) -> None:
        self.stretch, self.laplacian, self.embedding = stretch, laplacian, embedding
        self.weights, self.target = weights, target
        self.data = sparse.kron(embedding.T @ sparse.diags(weights) @ embedding, sparse.eye(3), format="csr")

    def linearise(self, x: Array) -> None:
        """Renew the Jacobian J, and the matrices of |L J dx|^2 and of |J dx|^2."""
        _, jacobian = self.stretch.linearise(x)
        root = sparse.diags(np.tile(np.sqrt(COUNTS), self.laplacian.shape[0]))
        scaled = (root @ jacobian).tocsr()
        smooth = sparse.kron(self.laplacian, sparse.eye(6), format="csr") @ scaled
        self.jacobian = jacobian
        self.smooth, self.near = (smooth.T @ smooth).tocsr(), (scaled.T @ scaled).tocsr()

    def factorise(self, pull: float) -> None:
        """Factor for a pull of gamma a_k towards a field."""
        self.pull = pull
        self.factor: Factor = factorise((self.smooth + pull * self.near + self.data).tocsr())

    def value(self, x: Array, field_: Array) -> float:
        return self._value(self.stretch(x), x, field_)

    def _value(self, s: Array, x: Array, field_: Array) -> float:
        rough = float((COUNTS * (self.laplacian @ s) ** 2).sum())
        away = float((self.weights[:, None] * (self.embedding @ x - self.target) ** 2).sum())
        return rough + away + self.pull * float((COUNTS * (s - field_) ** 2).sum())

    def gradient(self, x: Array, field_: Array) -> Array:
        """Half the gradient (n, 3), with the true Jacobian (Zheng 2022 Eq. 25)."""
        s, jacobian = self.stretch.linearise(x)
        return self._gradient(s, jacobian, x, field_)

    def _gradient(self, s: Array, jacobian: sparse.csr_matrix, x: Array, field_: Array) -> Array:
        by_strain = COUNTS * (self.laplacian @ (self.laplacian @ s) + self.pull * (s - field_))
        by_place = self.embedding.T @ (self.weights[:, None] * (self.embedding @ x - self.target))
        return (jacobian.T @ by_strain.ravel()).reshape(-1, 3) + by_place

    def step(self, x: Array, field_: Array) -> tuple[Array, float]:
        """Positions after a Gauss-Newton step by the factor at hand, and the decrease of the objective.

        The step is halved until the objective falls and no further tet is inside out. To be flat costs
        without bound, but a step can pass beyond that.
        """
        before, inverted = self.value(x, field_), self.stretch.inverted(x)
        gradient = self.gradient(x, field_)
        direction = -self.factor.solve(gradient.ravel()).reshape(-1, 3)
        slope = 2 * float((gradient * direction).sum())
        size = 1.0
        while size > SHORTEST:
            trial = x + size * direction
            after = self.value(trial, field_)
            if after <= before + ARMIJO * size * slope and self.stretch.inverted(trial) <= inverted:
                return trial, before - after
            size *= 0.5
        return x, 0.0

    def alone(self, x: Array, steps: int) -> Array:
        """The minimiser without the other poses, and the matrices there."""
        nothing = np.zeros((self.laplacian.shape[0], 6))
        for _ in range(steps):
            self.linearise(x)
            self.factorise(0.0)
            x, decrease = self.step(x, nothing)
            if decrease < CONVERGED * self.value(x, nothing):
                break
        self.linearise(x)
        return x

    def distance(self, x: Array) -> float:
        return float(np.linalg.norm(self.embedding @ x - self.target, axis=1).max())


class _Descent:
    """Block-coordinate descent over the poses, for one gamma after the other."""

    def __init__(self, blocks: Sequence[_Block], space: Array, options: StrainOptions) -> None:
        self.blocks, self.space, self.options = blocks, space, options

    def largest(self, x: Sequence[Array]) -> Array:
        """Largest distance (N,) of each pose's surface from its target."""
        return np.array([b.distance(v) for b, v in zip(self.blocks, x, strict=True)])

    def field(self, s: list[Array], k: int) -> Array:
        """The strains c_k that the other poses (and neutral, node 0) ask of pose k."""
        others = np.stack([np.zeros_like(s[0]), *s])
        others[k + 1] = 0.0
        column = self.space[:, k + 1]
        return -np.tensordot(column @ self.space, others, axes=1) / (column @ column)

    def with_gamma(self, x: Sequence[Array], gamma: float) -> tuple[list[Array], list[float]]:
        """Sweeps over all poses from x; the objective after each."""
        out, objectives = list(x), []
        s = [b.stretch(v) for b, v in zip(self.blocks, out, strict=True)]
        for k, block in enumerate(self.blocks):
            column = self.space[:, k + 1]
            block.factorise(gamma * float(column @ column))
        for _ in range(self.options.sweeps):
            decrease = 0.0
            for k, block in enumerate(self.blocks):
                out[k], gain = block.step(out[k], self.field(s, k))
                s[k] = block.stretch(out[k])
                decrease += gain
            objectives.append(self.objective(out, s, gamma))
            if decrease < CONVERGED * objectives[-1]:
                break
        return out, objectives

    def objective(self, x: Sequence[Array], s: Sequence[Array], gamma: float) -> float:
        """The whole of Zheng 2022 Eq. 3."""
        nodes = np.stack([np.zeros_like(s[0]), *s])
        rough = np.tensordot(self.space, nodes, axes=1)
        total = gamma * float((COUNTS * rough**2).sum())
        for block, v, strain in zip(self.blocks, x, s, strict=True):
            pull, block.pull = block.pull, 0.0
            total += block._value(strain, v, strain)
            block.pull = pull
        return total

    def with_largest_gamma(self, x: list[Array], allowed: float) -> tuple[list[Array], float, list[float]]:
        """The smoothest strains over poses whose surfaces stay within `allowed` mm.

        They are found by bisection of log gamma.
        """
        low, high = np.log(self.options.gammas)
        best, gamma, objectives = x, 0.0, []
        for i in range(self.options.bisections + 1):
            middle = 0.5 * (low + high) if i else low
            found, values = self.with_gamma(best, float(np.exp(middle)))
            distance = float(self.largest(found).max())
            log.info(
                "gamma %.3g: largest distance %.3f mm, objective %.4g", np.exp(middle), distance, values[-1]
            )
            if distance <= allowed:
                best, gamma, objectives = found, float(np.exp(middle)), values
                low = middle
            elif i == 0:
                break
            else:
                high = middle
        return best, gamma, objectives
