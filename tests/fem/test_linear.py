"""Sparse factorisations: every backend, definite and not."""

import os
import subprocess
import sys

import numpy as np
import psutil
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box

from handpipe.fem.elements.materials import Material
from handpipe.fem.linear import factorisation as linear
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials.elastic import Elastic

PREDICTING = [
    pytest.param(
        linear.CLASSES[name],
        marks=pytest.mark.skipif(not linear.PRESENT[name](), reason=f"{name} is not installed"),
        id=name,
    )
    for name in ("mkl", "rslab")
]
BACKENDS = [*PREDICTING, pytest.param(linear.SuperLUFactor, id="scipy")]


def _stiffness(shift, cells=(4, 3, 3)):
    vertices, tets = box((2.0, 1.0, 1.0), cells)
    matrix = Elastic(vertices, tets, Material(6.0, 0.48)).hessian(vertices)
    return sp.csr_matrix(matrix + shift * sp.eye(matrix.shape[0]))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("shift", "positive"), [(1.0, True), (1.0, False), (-2.0, False)])
def test_solutions_match_dense_ones(backend, shift, positive):
    matrix = _stiffness(shift)
    b = np.random.default_rng(0).normal(size=(matrix.shape[0], 3))
    factor = backend(matrix, positive)
    expected = np.linalg.solve(matrix.toarray(), b)
    np.testing.assert_allclose(factor.solve(b), expected, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(factor.solve(b[:, 1]), expected[:, 1], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("backend", BACKENDS)
def test_indefinite_matrices_are_found_out_and_a_factor_survives_it(backend):
    good, bad = _stiffness(1.0), _stiffness(-2.0)
    with pytest.raises(linear.NotPositiveDefinite):
        backend(bad, True)
    factor = backend(good, True)
    with pytest.raises(linear.NotPositiveDefinite):
        factor.refactorise(bad)
    factor.refactorise(good)
    b = np.ones(good.shape[0])
    np.testing.assert_allclose(good @ factor.solve(b), b, atol=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
def test_refactorisation_takes_new_values_and_new_patterns(backend):
    matrix = _stiffness(1.0)
    factor = backend(matrix, True)
    b = np.arange(matrix.shape[0], dtype=float)
    for other in (
        sp.csr_matrix((2 * matrix.data, matrix.indices, matrix.indptr)),
        sp.csr_matrix(2 * sp.eye(len(b))),
    ):
        factor.refactorise(other)
        np.testing.assert_allclose(other @ factor.solve(b), b, atol=1e-8)


@pytest.mark.parametrize("backend", PREDICTING)
def test_equal_patterns_are_analysed_once_whether_shared_or_not(backend, monkeypatch):
    analyses = []
    analyse = backend._analyse
    monkeypatch.setattr(backend, "_analyse", lambda self, m: (analyses.append(1), analyse(self, m)))
    matrix = _stiffness(1.0)
    factor = backend(matrix, True)
    factor.refactorise(sp.csr_matrix((2 * matrix.data, matrix.indices, matrix.indptr)))
    copied = sp.csr_matrix((3 * matrix.data, matrix.indices.copy(), matrix.indptr.copy()))
    factor.refactorise(copied)
    assert len(analyses) == 1
    b = np.ones(matrix.shape[0])
    np.testing.assert_allclose(3 * matrix @ factor.solve(b), b, atol=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
def test_two_factors_live_side_by_side(backend):
    one, two = _stiffness(1.0), _stiffness(5.0, (3, 3, 5))
    first, second = backend(one, True), backend(two, True)
    for matrix, factor in ((one, first), (two, second), (one, first)):
        b = np.ones(matrix.shape[0])
        np.testing.assert_allclose(matrix @ factor.solve(b), b, atol=1e-9)
    del second
    b = np.ones(one.shape[0])
    np.testing.assert_allclose(one @ first.solve(b), b, atol=1e-9)


@pytest.mark.parametrize("backend", PREDICTING)
def test_deleted_factors_return_their_memory(backend):
    matrix = _stiffness(1.0, (12, 6, 6))
    size = 8 * backend(matrix, True).work.entries
    resident = []
    for _ in range(60):
        backend(matrix, True)
        resident.append(psutil.Process().memory_info().rss)
    # An allocator's caches move single readings by several factors; a leak lifts the least of them by 40.
    assert min(resident[40:]) - min(resident[:20]) < 20 * size


@pytest.mark.parametrize("backend", PREDICTING)
def test_predicted_work_matches_a_dense_factor(backend):
    n = 200
    dense = np.full((n, n), 0.1) + 2 * np.eye(n)
    work = backend(sp.csr_matrix(dense), True).work
    assert n**2 / 2 < work.entries < n**2  # panels may be stored whole
    assert n**3 / 6 < work.flops < 1.1 * n**3  # libraries count with or without what is symmetric
    assert work.bytes > 8 * n**2 / 2


@pytest.mark.parametrize("backend", BACKENDS)
def test_factors_beyond_the_limit_are_refused(backend):
    matrix = _stiffness(1.0)
    with pytest.raises(linear.FactorTooLarge, match="MiB"):
        backend(matrix, True, 1e4)
    assert backend(matrix, True, 1e9).work.entries > matrix.nnz / 2


def test_superlu_leaves_large_systems_to_multigrid():
    large = sp.csr_matrix(2 * sp.eye(41_000))
    with pytest.raises(linear.FactorTooLarge):
        linear.SuperLUFactor(large, True, 1e12)
    np.testing.assert_allclose(linear.SuperLUFactor(large).solve(np.ones(41_000)), 0.5)


def test_free_block_is_the_submatrix():
    matrix = _stiffness(1.0)
    free = np.random.default_rng(0).random(matrix.shape[0]) < 0.6
    block = FreeBlock(matrix, free).matrix(matrix)
    np.testing.assert_array_equal(block.toarray(), matrix.toarray()[np.ix_(free, free)])


@pytest.mark.parametrize("wanted", ["scipy", "rslab"])
def test_the_environment_chooses(wanted):
    code = f"""
import numpy as np, scipy.sparse as sp
from handpipe.fem.linear import factorisation as linear
assert linear.backend == {wanted!r}
assert np.allclose(linear.factorise(sp.csr_matrix(2 * sp.eye(3))).solve(np.ones(3)), 0.5)
"""
    subprocess.run([sys.executable, "-c", code], env={**os.environ, "HANDPIPE_SOLVER": wanted}, check=True)


def test_an_unknown_solver_is_named():
    run = subprocess.run(
        [sys.executable, "-c", "import handpipe.fem.linear.factorisation"],
        env={**os.environ, "HANDPIPE_SOLVER": "abacus"},
        capture_output=True,
        text=True,
    )
    assert run.returncode != 0
    assert "abacus" in run.stderr and "rslab" in run.stderr
