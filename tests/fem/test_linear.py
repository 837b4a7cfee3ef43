"""Sparse solves: both backends, definite and not."""

import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box

from handpipe.fem import linear
from handpipe.fem.elastic import Elastic
from handpipe.fem.materials import Material
from handpipe.fem.reduction import FreeBlock

BACKENDS = [
    pytest.param(
        linear.PardisoFactor,
        marks=pytest.mark.skipif(linear.PardisoFactor.library is None, reason="MKL is not installed"),
    ),
    linear.SupernodalFactor,
    linear.SuperLUFactor,
]


def _stiffness(shift):
    vertices, tets = box((2.0, 1.0, 1.0), (4, 3, 3))
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


def test_free_block_is_the_submatrix():
    matrix = _stiffness(1.0)
    free = np.random.default_rng(0).random(matrix.shape[0]) < 0.6
    block = FreeBlock(matrix, free).matrix(matrix)
    np.testing.assert_array_equal(block.toarray(), matrix.toarray()[np.ix_(free, free)])


def test_the_environment_can_ask_for_scipy():
    code = "from handpipe.fem import linear; assert linear.backend == 'scipy'"
    subprocess.run([sys.executable, "-c", code], env={**os.environ, "HANDPIPE_SOLVER": "scipy"}, check=True)
