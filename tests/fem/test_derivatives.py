"""Every potential: gradient and Hessian against differences."""

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box, box_surface, sphere

from handpipe.fem import plasticity
from handpipe.fem.barrier import Barrier
from handpipe.fem.bending import Bending
from handpipe.fem.cloth import Membrane
from handpipe.fem.constraints import Attachment, Contact, Sliding, SurfaceContact
from handpipe.fem.elastic import Elastic
from handpipe.fem.materials import Material
from handpipe.fem.potential import Sum
from handpipe.fem.pull import Pull
from handpipe.fem.surface_sliding import SurfaceSliding
from handpipe.mesh.distance import Distance
from handpipe.mesh.surface import Surface

VERTICES, TETS = box((2.0, 1.0, 1.0), (2, 2, 2))
POINTS, TRIANGLES = sphere(1.0, 1)


def _operator(count, vertices, seed=0):
    rng = np.random.default_rng(seed)
    rows = np.repeat(np.arange(count), 4)
    columns = np.concatenate([rng.choice(len(vertices), 4, replace=False) for _ in range(count)])
    weights = rng.dirichlet(np.ones(4), count).ravel()
    return sp.csr_matrix((weights, (rows, columns)), shape=(count, len(vertices)))


def _elastic(model, state):
    rng = np.random.default_rng(1)
    strains = plasticity.exp(0.2 * rng.normal(size=(len(TETS), 6)))
    weights = rng.uniform(0.2, 1.0, len(TETS))
    elastic = Elastic(VERTICES, TETS, Material(6.0, 0.48, model), strains, weights)
    noise = 0.05 * rng.normal(size=VERTICES.shape)
    x = {
        "random": VERTICES + noise,
        "flat": VERTICES * [1.0, 1.0, 1e-6] + 1e-7 * noise,
        "inverted": VERTICES * [1.0, 1.0, -0.7] + noise,
    }[state]
    return elastic, x


def _planes(kind):
    operator = _operator(12, VERTICES)
    rng = np.random.default_rng(2)
    origins = operator @ VERTICES + 0.1 * rng.normal(size=(12, 3))
    return kind(operator, origins, rng.normal(size=(12, 3)), rng.uniform(1, 5, 12)), VERTICES


def _surface_contact():
    surface = Surface(*box_surface((4.0, 4.0, 2.0), (-1.0, -1.0, -1.7)))
    lowest = sp.eye(len(VERTICES), format="csr")[VERTICES[:, 2] < 0.1]
    x = VERTICES + 0.02 * np.random.default_rng(3).normal(size=VERTICES.shape)
    return SurfaceContact(lowest, Distance(surface), 3.0, thickness=0.1), x


def _surface_sliding():
    surface = Surface(*box_surface((4.0, 4.0, 2.0), (-1.0, -1.0, -1.7)))
    operator = sp.eye(len(VERTICES), format="csr")[VERTICES[:, 2] < 0.1]
    x = VERTICES + 0.2 * np.random.default_rng(3).normal(size=VERTICES.shape)  # some inside, some outside
    return SurfaceSliding(operator, Distance(surface), np.arange(1.0, 1.0 + operator.shape[0])), x


def _barrier():
    obstacle = box_surface((4.0, 4.0, 1.0), (-2.0, -2.0, -2.05))
    x = POINTS + 0.003 * np.random.default_rng(4).normal(size=POINTS.shape)
    identity = sp.eye(len(POINTS), format="csr")
    return Barrier(identity, TRIANGLES, POINTS, 0.15, 10.0, obstacle=obstacle), x


def _cases():
    targets = np.random.default_rng(0).normal(size=(5, 3))
    for model in ("stable-neo-hookean", "stvk"):
        for state in ("random", "flat", "inverted"):
            yield f"{model}-{state}", lambda model=model, state=state: _elastic(model, state)
    yield "attachment", lambda: (Attachment(_operator(5, VERTICES), targets, np.arange(1.0, 6.0)), VERTICES)
    yield "sliding", lambda: _planes(Sliding)
    yield "contact", lambda: _planes(Contact)
    yield "surface-contact", _surface_contact
    yield "surface-sliding", _surface_sliding
    yield "pull", lambda: (Pull(_operator(5, VERTICES), targets), VERTICES)
    yield "barrier", _barrier
    rng = np.random.default_rng(5)
    rough = POINTS + 0.1 * rng.normal(size=POINTS.shape)
    yield "membrane-tension", lambda: (Membrane(POINTS, TRIANGLES, Material(0.1, 0.48), 0.5, 0.4), rough)
    yield "membrane-slack", lambda: (Membrane(POINTS, TRIANGLES, Material(0.1, 0.48), 0.5, 1.5), rough)
    yield "bending-flat", lambda: (Bending(POINTS, TRIANGLES, 0.3), rough)
    yield "bending-curved", lambda: (Bending(POINTS, TRIANGLES, 0.3, curved=True), rough)
    yield (
        "sum",
        lambda: (Sum([_elastic("stvk", "random")[0], _planes(Contact)[0], _planes(Sliding)[0]]), VERTICES),
    )


CASES = dict(_cases())


@pytest.mark.parametrize("name", CASES)
def test_derivatives_agree_with_differences(name):
    potential, x = CASES[name]()
    rng = np.random.default_rng(7)
    direction = rng.normal(size=x.shape)
    direction /= np.linalg.norm(direction)
    step = 1e-6
    ahead, behind = x + step * direction, x - step * direction
    slope = (potential.value(ahead) - potential.value(behind)) / (2 * step)
    gradient = potential.gradient(x)
    scale = np.linalg.norm(gradient)
    assert scale > 0
    noise = 1e-14 * abs(potential.value(x)) / step
    assert np.vdot(gradient, direction) == pytest.approx(slope, abs=1e-6 * scale + noise)

    turned = (potential.gradient(ahead) - potential.gradient(behind)).ravel() / (2 * step)
    hessian = potential.hessian(x)
    assert hessian.has_sorted_indices
    np.testing.assert_allclose(
        hessian @ direction.ravel(), turned, atol=2e-5 * max(np.abs(turned).max(), 1e-12)
    )
    assert abs(hessian - hessian.T).max() <= 1e-10 * max(abs(hessian).max(), 1e-300)


@pytest.mark.parametrize("name", CASES)
def test_projected_hessian_is_positive_semidefinite(name):
    potential, x = CASES[name]()
    values = np.linalg.eigvalsh(potential.hessian(x, project=True).toarray())
    assert values[0] >= -1e-9 * max(values[-1], 1e-12)


@pytest.mark.parametrize("model", ["stable-neo-hookean", "stvk"])
def test_projection_changes_nothing_at_rest(model):
    elastic = Elastic(VERTICES, TETS, Material(6.0, 0.48, model))
    difference = elastic.hessian(VERTICES, project=True) - elastic.hessian(VERTICES)
    assert abs(difference).max() < 1e-10 * abs(elastic.hessian(VERTICES)).max()
