"""A muscle between bones that have moved, guessed without an image: it contracts along its fibres.

Wang 2021 §6.1.3, Eq. 6.5. Fibres follow the gradient of a harmonic coordinate that is 1 at one bone's
attachment and 0 at the others'. The log-stretch along them is U a, a few B-splines of that coordinate with
weights a: like the thesis' bounded biharmonic handles they are smooth, within [0, 1] and of sum one, and
nobody has to place them. Minimises

    W(a) = (least elastic and attachment energy under the plastic strains of U a) / (mu V) + |L U a|^2 / 2

By the envelope theorem dW/da needs the energy's derivative by the strains at the equilibrium alone. Unlike
the thesis' diag(a, 1, 1) the strain keeps volume, as a muscle does: it thickens where it shortens.
"""

from __future__ import annotations

import logging

import numpy as np
from scipy import optimize
from scipy.interpolate import BSpline

from handpipe.core import Array
from handpipe.fem.contact import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Elastic, strain_gradient
from handpipe.fem.solver import equilibrium
from handpipe.mesh.tets import shape_gradients, tet_laplacian
from handpipe.shapes.optimisation import MUSCLE
from handpipe.tissues.muscles.fitting.soft_body import SoftBody, Transforms

log = logging.getLogger(__name__)

HANDLES = 4  # weights of the interpolation, which are searched for
SPRING = 500.0  # mN/mm of an attached point, as in the fit to images
SHORTEST = 0.6  # of its length at rest, to which a muscle can contract
ITERATIONS = 15  # of the search, at most
TOLERANCE = 1e-4  # of dW/da


def fibres(body: SoftBody, coordinate: Array) -> Array:
    """Unit directions (m, 3) along which a coordinate (n,) of the mesh rises."""
    gradients = shape_gradients(body.mesh.vertices, body.mesh.tets)
    along = np.einsum("mc,mci->mi", coordinate[body.mesh.tets], gradients)
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)


def contracted(body: SoftBody, transforms: Transforms, start: Array) -> Array:
    """Mesh vertices (n, 3) of a body contracted along its fibres between moved bones, from a start (n, 3).

    Raises
    ------
    ConvergenceError
        Where no equilibrium is found at the start.
    """
    search = Contraction(body, transforms, start)
    options = {"maxiter": ITERATIONS, "gtol": TOLERANCE}
    found = optimize.minimize(search, np.zeros(HANDLES), jac=True, method="BFGS", options=options)
    log.info("contraction: log-stretches %s, energy %.3g", np.round(found.x, 3), found.fun)
    search(found.x)
    return search.x


def slack(body: SoftBody, transforms: Transforms, start: Array) -> Array:
    """Mesh vertices (n, 3) of an elastic body between moved bones, not contracted, from a start (n, 3).

    Raises
    ------
    ConvergenceError
        Where no equilibrium is found.
    """
    search = Contraction(body, transforms, start)
    search(np.zeros(HANDLES))
    return search.x


def taut(body: SoftBody, transforms: Transforms, start: Array) -> Array:
    """Mesh vertices (n, 3) of a body that pulls as hard as it can between moved bones, from a start (n, 3).

    It takes the short way from bone to bone, past joints that flesh and skin go around.

    Raises
    ------
    ConvergenceError
        Where no equilibrium is found.
    """
    search = Contraction(body, transforms, start)
    search(np.full(HANDLES, np.log(SHORTEST)))
    return search.x


class Contraction:
    """W and its derivative (HANDLES,) by the weights a; x (n, 3): the equilibrium of the last ones."""

    def __init__(self, body: SoftBody, transforms: Transforms, start: Array) -> None:
        coordinate = body.harmonic_weights()[:, 0]
        along = fibres(body, coordinate)
        across = np.eye(3) - along[:, :, None] * along[:, None, :]
        self._stretch = plasticity.from_matrices(along[:, :, None] * along[:, None, :] - 0.5 * across)
        self._basis = _splines(coordinate[body.mesh.tets].mean(axis=1))
        rough = tet_laplacian(body.mesh.tets) @ self._basis
        self._rough = rough.T @ rough
        self._elastic = Elastic(body.mesh.vertices, body.mesh.tets, MUSCLE)
        attached = body.attached(transforms)
        self._springs = Attachment(attached.matrix, attached.targets, SPRING)
        self._scale = 1.0 / float(MUSCLE.lame(1)[0][0] * body.mesh.volumes().sum())
        self.x = start

    def __call__(self, weights: Array) -> tuple[float, Array]:
        """W and dW/da (HANDLES,) at the weights a (HANDLES,), with `x` set to the equilibrium."""
        logs = (self._basis @ weights)[:, None] * self._stretch
        elastic = self._elastic.with_strains(plasticity.exp(logs))
        self.x = equilibrium.solve([elastic, self._springs], self.x).x
        energy = elastic.value(self.x) + self._springs.value(self.x)
        by_logs = np.einsum("ma,mab->mb", strain_gradient(elastic, self.x), plasticity.exp_derivative(logs))
        by_weights = self._basis.T @ (by_logs * self._stretch).sum(axis=1)
        smooth = self._rough @ weights
        value = self._scale * energy + 0.5 * float(weights @ smooth)
        return value, self._scale * by_weights + smooth


def _splines(coordinate: Array) -> Array:
    """Values (m, HANDLES) of the quadratic B-splines over [0, 1] at a coordinate (m,)."""
    degree = 2
    knots = np.concatenate([np.zeros(degree), np.linspace(0, 1, HANDLES - degree + 1), np.ones(degree)])
    return BSpline.design_matrix(np.clip(coordinate, 0, 1), knots, degree).toarray()
