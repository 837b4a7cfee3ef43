"""Derivatives of a body's energy by its plastic strains (Wang 2021 Appendix B).

With S the plastic strain, G its inverse, A = F G and e = w V0 |S| psi(A): a change Y of S changes G by
-G Y G, |S| by |S| tr(G Y) and A by -A Y G. The derivative of forces is `Elastic.strain_jacobian`.
"""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.fem.elements import materials, plasticity
from handpipe.fem.potentials.elastic import Elastic

BASIS = plasticity.to_matrices(np.eye(6))  # (6, 3, 3): the change of S with each of its six numbers


def strain_gradient(body: Elastic, x: Array) -> Array:
    """Derivative of a body's energy by its plastic strains.

    de[Y] = w V0 |S| (tr(G Y) psi - P : (A Y G))

    Parameters
    ----------
    body : Elastic
        Body with m tets under plastic strains.
    x : array (n, 3)
        Positions in mm.

    Returns
    -------
    array (m, 6)
        Derivatives in µJ by the six numbers of each tet's strain.

    References
    ----------
    Wang 2021 Appendix B.
    """
    state = _State(body, x)
    change = state.trace * state.density[:, None] - np.einsum("eij,eaij->ea", state.stress, state.turned)
    return state.volume[:, None] * change


def strain_hessian(body: Elastic, x: Array) -> Array:
    """Second derivative (m, 6, 6) of the energy by the strains, tet by tet.

    d2e[Y, Z] = w V0 |S| (tr(GZ) tr(GY) psi - tr(GZGY) psi - tr(GZ) P : (AYG) - tr(GY) P : (AZG)
                          + dP[AZG] : (AYG) + P : (AZGYG + AYGZG))
    """
    state = _State(body, x)
    count = len(body.tets)
    work = np.einsum("eij,eaij->ea", state.stress, state.turned)
    traces = np.einsum("eaij,ebji->eab", state.relative, state.relative)
    pulled = state.turned.reshape(count, 6, 9)
    twice = np.einsum("eaij,ebjk->eabik", state.turned, state.relative_after)
    twice = np.einsum("eik,eabik->eab", state.stress, twice)
    change = (
        state.density[:, None, None] * (state.trace[:, :, None] * state.trace[:, None, :] - traces)
        - state.trace[:, :, None] * work[:, None, :]
        - work[:, :, None] * state.trace[:, None, :]
        + np.einsum("eai,eij,ebj->eab", pulled, state.stiffness, pulled)
        + twice
        + twice.transpose(0, 2, 1)
    )
    return state.volume[:, None, None] * change


class _State:
    """What both derivatives need: psi, P, dP/dA, and A Y G, G Y, Y G for the six changes Y."""

    def __init__(self, body: Elastic, x: Array) -> None:
        elastic = body.elastic_gradients(x)
        inverse = plasticity.inverse_matrices(body.strains)
        model, (mu, lam) = materials.MODELS[body.material.model], body.material.lame(len(body.tets))
        mu, lam = np.ascontiguousarray(mu), np.ascontiguousarray(lam)
        self.density = materials.energy_densities(model, elastic, mu, lam)
        self.stress = materials.piola_stresses(model, elastic, mu, lam)
        self.stiffness = materials.stiffnesses(model, elastic, mu, lam)
        self.volume = body.weights * body.volumes * plasticity.determinants(body.strains)
        self.relative = np.einsum("eij,ajk->eaik", inverse, BASIS)
        self.relative_after = np.einsum("aij,ejk->eaik", BASIS, inverse)
        self.turned = np.einsum("eij,eajk->eaik", elastic, self.relative_after)
        self.trace = np.einsum("eaii->ea", self.relative)
