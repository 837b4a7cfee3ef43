"""Assembly: threads, reuse of arrays, projection and the sum of matrices."""

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box

from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.elements.materials import MODELS, Material, stiffnesses
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.patterns.assembly import Pattern
from handpipe.fem.patterns.partition import Partition, spatial_order
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.potential import Sum

VERTICES, TETS = box((4.0, 2.0, 1.0), (5, 3, 2))


def _body(model="stable-neo-hookean", seed=0):
    rng = np.random.default_rng(seed)
    strains = plasticity.exp(0.3 * rng.normal(size=(len(TETS), 6)))
    elastic = Elastic(VERTICES, TETS, Material(6.0, 0.45, model), strains, rng.uniform(0.1, 1, len(TETS)))
    return elastic, VERTICES + 0.1 * rng.normal(size=VERTICES.shape)


@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize("parts", [2, 5])
def test_parts_do_not_change_a_bit(parts, project):
    one, x = _body()
    many, _ = _body()
    many._partition = Partition.of_cells(many._body.tets, VERTICES, parts)
    assert many._partition.parts == parts
    assert one.value(x) == many.value(x)
    np.testing.assert_array_equal(one.gradient(x), many.gradient(x))
    np.testing.assert_array_equal(one.hessian(x, project).data, many.hessian(x, project).data)


def test_partition_shares_the_work_and_visits_every_owner():
    points, cells = box((6.0, 1.0, 1.0), (24, 4, 4))
    share = Partition.of_cells(cells, points, 4).share
    assert sorted(share.vertices) == list(range(len(points)))
    for part in range(4):
        own = share.cells[share.cell_starts[part] : share.cell_starts[part + 1]]
        touched = np.flatnonzero((share.owner[cells] == part).any(axis=1))
        np.testing.assert_array_equal(own, touched)
    assert np.diff(share.cell_starts).max() < 0.35 * len(cells)


def test_spatial_order_keeps_neighbours_together():
    grid = np.stack(np.meshgrid(*[np.arange(8.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    shuffled = grid[np.random.default_rng(0).permutation(len(grid))]
    ordered = shuffled[spatial_order(shuffled)]
    jumps = np.linalg.norm(np.diff(ordered, axis=0), axis=1)
    assert jumps.mean() < 0.4 * np.linalg.norm(np.diff(shuffled, axis=0), axis=1).mean()
    assert {tuple(p) for p in ordered} == {tuple(p) for p in grid}


@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize("model", MODELS)
def test_one_tet_is_the_stress_derivative_and_its_clamped_eigenvalues(model, project):
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0.1, 1, 0], [0.2, 0.3, 1]])
    tet = np.array([[0, 1, 2, 3]])
    body = Elastic(vertices, tet, Material(6.0, 0.4, model))
    indefinite = 0
    for seed in range(10):
        x = vertices + 0.7 * np.random.default_rng(seed).normal(size=(4, 3))
        mu, lam = body.material.lame(1)
        derivative = stiffnesses(MODELS[model], body.deformation_gradients(x), mu, lam)[0]
        if project:
            values, vectors = np.linalg.eigh(derivative)
            indefinite += values[0] < 0
            derivative = (vectors * np.maximum(values, 0)) @ vectors.T
        # dF_jl = dx_bj g_bl
        operator = np.einsum("bl,jc->jlbc", body.rest_gradients[0], np.eye(3)).reshape(9, 12)
        expected = body.volumes[0] * operator.T @ derivative @ operator
        found = body.hessian(x, project).toarray()
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
    assert indefinite >= 5 or not project


def test_a_kept_matrix_stays_and_a_dropped_one_is_used_again():
    body, x = _body()
    kept = body.hessian(x)
    before = kept.data.copy()
    view = body.hessian(2 * x).data[3:10]
    values = view.copy()
    for factor in (1.5, 0.5, 3.0, 0.1):
        body.hessian(factor * x)
    np.testing.assert_array_equal(kept.data, before)
    np.testing.assert_array_equal(view, values)
    addresses = set()
    for _ in range(5):
        matrix = body.hessian(x)
        addresses.add(matrix.data.ctypes.data)
        del matrix
    assert len(addresses) == 1


def test_sum_is_the_sum_of_matrices_and_its_results_are_kept():
    body, x = _body()
    rng = np.random.default_rng(1)
    far = sp.csr_matrix((np.ones(4), ([0, 0, 1, 1], [0, 70, 3, 50])), shape=(2, len(VERTICES)))
    springs = Attachment(far, rng.normal(size=(2, 3)), [1.0, 2.0])
    own = Attachment(sp.eye(len(VERTICES), format="csr"), VERTICES, 0.5)
    for parts in ([springs, body, own], [body, own]):  # the union is new; the union is the body's pattern
        total = Sum(parts)
        first = total.hessian(x)
        expected = sum(p.hessian(x) for p in parts)
        assert abs(first - expected).max() < 1e-12 * abs(expected).max()
        before = first.copy()
        second = total.hessian(1.3 * x)
        assert abs(first - before).max() == 0.0
        assert abs(second - sum(p.hessian(1.3 * x) for p in parts)).max() < 1e-12 * abs(expected).max()
        free = np.arange(x.size) % 3 > 0
        block = FreeBlock(first, free)
        np.testing.assert_array_equal(block.matrix(second).toarray(), second.toarray()[free][:, free])


def test_large_matrices_merge_as_small_ones(monkeypatch):
    body, x = _body()
    own = Attachment(sp.eye(len(VERTICES), format="csr"), VERTICES, 0.5)
    small = Sum([body, own]).hessian(x)
    monkeypatch.setattr("handpipe.fem.potentials.potential.PARALLEL_ENTRIES", 0)
    monkeypatch.setattr("handpipe.fem.minimisation.reduction.PARALLEL_ENTRIES", 0)
    large = Sum([body, own]).hessian(x)
    np.testing.assert_array_equal(small.data, large.data)
    free = np.arange(x.size) % 2 > 0
    np.testing.assert_array_equal(
        FreeBlock(large, free).matrix(large).toarray(), small.toarray()[free][:, free]
    )


def test_pattern_is_that_of_the_cells():
    pattern = Pattern.of_cells(TETS, len(VERTICES))
    rows, columns = np.repeat(TETS, 4, axis=1).ravel(), np.tile(TETS, (1, 4)).ravel()
    expected = sp.coo_matrix((np.ones(len(rows)), (rows, columns))).tocsr()
    expected = sp.kron(expected, np.ones((3, 3))).tocsr()
    expected.sort_indices()
    np.testing.assert_array_equal(pattern.indptr, expected.indptr)
    np.testing.assert_array_equal(pattern.indices, expected.indices)
