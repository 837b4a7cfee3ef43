"""Factors in single precision: solutions as good as asked for, and double precision where single fails."""

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from tests.fem.bodies import box

from handpipe.fem.contact import Attachment
from handpipe.fem.elements import Material
from handpipe.fem.linear.factorisation import NotPositiveDefinite, backend, factorise
from handpipe.fem.linear.system_sequence import SystemSequence
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Options, equilibrium

REST, TETS = box((2.0, 1.0, 1.0), (8, 4, 4))
FREE = np.repeat(REST[:, 0] > 0, 3)
FORCES = np.random.default_rng(0).normal(size=FREE.sum())


def stiffness(stretch: float = 1.0) -> sp.csr_matrix:
    """Of a bar that is held at one end and stretched."""
    full = Elastic(REST, TETS, Material(1.0, 0.48)).hessian(REST * np.array([stretch, 1.0, 1.0]))
    return FreeBlock(full, FREE).matrix(full)


@pytest.mark.skipif(backend != "mkl", reason="only MKL factorises in single precision")
def test_a_single_factor_is_rounded_and_smaller() -> None:
    matrix = stiffness()
    double, single = factorise(matrix), factorise(matrix, single=True)
    residuals = [np.linalg.norm(FORCES - matrix @ f.solve(FORCES)) for f in (double, single)]
    assert residuals[0] < 1e-10 < 1e-7 < residuals[1] < 1e-2
    assert single.work.bytes < 0.8 * double.work.bytes


def test_small_forces_are_not_lost() -> None:
    matrix, factor = stiffness(), factorise(stiffness(), single=True)
    assert np.allclose(1e60 * factor.solve(1e-60 * FORCES), factor.solve(FORCES), rtol=1e-5)
    assert not factor.solve(np.zeros(matrix.shape[0])).any()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-9])
def test_solutions_are_as_good_as_asked_for(tolerance: float) -> None:
    sequence = SystemSequence(memory_limit=1e12, single=True)
    for stretch in (1.0, 1.05):
        matrix = stiffness(stretch)
        x = sequence.solve(matrix, FORCES, tolerance=tolerance)
        exact = spla.spsolve(matrix.tocsc(), FORCES)
        assert np.linalg.norm(FORCES - matrix @ x) <= tolerance * np.linalg.norm(FORCES)
        assert (x - exact) @ (matrix @ (x - exact)) <= (3 * tolerance) ** 2 * (exact @ (matrix @ exact))


def test_where_single_precision_fails_factors_are_double(caplog: pytest.LogCaptureFixture) -> None:
    """Springs of 1e9 times the stiffness: positive definite, but not in single precision.

    Rounding of their products alone leaves a residual of about 1e-6.
    """
    between = np.random.default_rng(1).normal(size=(40, FORCES.size)) / np.sqrt(FORCES.size)
    matrix = (stiffness() + 1e9 * sp.csr_matrix(between.T @ between)).tocsr()
    sequence = SystemSequence(memory_limit=1e12, single=True)
    with caplog.at_level("INFO"):
        x = sequence.solve(matrix, FORCES, tolerance=1e-5)
    assert np.linalg.norm(FORCES - matrix @ x) <= 1e-5 * np.linalg.norm(FORCES)
    assert backend != "mkl" or "double precision from here on" in caplog.text


def test_indefinite_matrices_are_found_out_and_factors_stay_single(caplog: pytest.LogCaptureFixture) -> None:
    good = stiffness()
    bad = sp.csr_matrix(good - 0.9 * sp.diags(good.diagonal()))
    sequence = SystemSequence(memory_limit=1e12, single=True)
    with caplog.at_level("INFO"), pytest.raises(NotPositiveDefinite):
        sequence.solve(bad, FORCES)
    assert "double precision" not in caplog.text
    x = sequence.solve(good, FORCES, tolerance=1e-6)
    assert np.linalg.norm(FORCES - good @ x) <= 1e-6 * np.linalg.norm(FORCES)


def test_an_equilibrium_is_the_same() -> None:
    ends = np.flatnonzero(REST[:, 0] == 2.0)
    matrix = sp.identity(len(REST), format="csr")[ends]
    pull = Attachment(matrix, REST[ends] + [0.5, 0.3, 0.0], np.full(len(ends), 5.0))
    found = [
        equilibrium.solve(
            [Elastic(REST, TETS, Material(1.0, 0.48)), pull],
            REST,
            fixed=np.repeat((REST[:, 0] == 0)[:, None], 3, axis=1),
            options=Options(displacement_tolerance=1e-6, force_tolerance=1e-6, single=single),
        )
        for single in (False, True)
    ]
    assert np.abs(found[0].x - REST).max() > 0.2
    assert np.abs(found[1].x - found[0].x).max() < 1e-5
