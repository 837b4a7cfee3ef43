"""Sequences of systems: old factors, renewals, multigrid, failures."""

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from tests.fem.bodies import box

from handpipe.core.errors import InputError
from handpipe.fem.elements.materials import Material
from handpipe.fem.linear.conjugate_gradients import End, conjugate_gradients
from handpipe.fem.linear.factorisation import NotPositiveDefinite, SingularMatrix, Work
from handpipe.fem.linear.multigrid import Multigrid
from handpipe.fem.linear.system_sequence import Ageing, SystemSequence
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials.elastic import Elastic

EVERYTHING = 1e12
NOTHING = 1.0


class Bar:
    """A bar held at one end; `stretched(s)` is its stiffness where it is s times as long."""

    def __init__(self, n=4, poisson=0.45, young=6.0):
        self.rest, self.tets = box((2.0, 1.0, 1.0), (2 * n, n, n))
        self.body = Elastic(self.rest, self.tets, Material(young, poisson))
        self.free = np.repeat(self.rest[:, 0] > 0, 3)
        self.b = np.random.default_rng(0).normal(size=self.free.sum())

    def stretched(self, s):
        full = self.body.hessian(self.rest * np.array([s, 1.0, 1.0]))
        return FreeBlock(full, self.free).matrix(full)


@pytest.fixture
def dear_factors(monkeypatch):
    """Factorisations that seem to cost hundreds of iterations, as those of large systems do."""
    monkeypatch.setattr(Work, "price", 400.0)


def _relative_residual(matrix, x, b):
    return np.linalg.norm(b - matrix @ x) / np.linalg.norm(b)


@pytest.mark.usefixtures("dear_factors")
@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-9])
def test_nearby_systems_are_solved_by_an_old_factor_as_well_as_asked(tolerance):
    bar, sequence = Bar(), SystemSequence(memory_limit=EVERYTHING)
    for s in (1.0, 1.05, 1.1):
        matrix = bar.stretched(s)
        x = sequence.solve(matrix, bar.b, tolerance=tolerance, free=bar.free)
        assert _relative_residual(matrix, x, bar.b) <= tolerance
        assert sequence.residual <= tolerance
        exact = spla.spsolve(matrix.tocsc(), bar.b)
        error = x - exact
        assert error @ (matrix @ error) <= (3 * tolerance) ** 2 * (exact @ (matrix @ exact))
    assert sequence.factorisations == 1
    assert sequence.cg_iterations > 2


def test_small_systems_are_always_factorised():
    bar, sequence = Bar(2), SystemSequence(memory_limit=EVERYTHING)
    for s in (1.0, 1.01, 1.02):
        sequence.solve(bar.stretched(s), bar.b)
    assert (sequence.factorisations, sequence.cg_iterations) == (3, 0)


@pytest.mark.usefixtures("dear_factors")
def test_a_factor_too_old_is_renewed_and_serves_again():
    bar, sequence = Bar(), SystemSequence(memory_limit=EVERYTHING)
    rigid = Bar(poisson=0.3, young=6.0 * np.geomspace(1, 1e6, len(bar.tets)))
    sequence.solve(bar.stretched(1.0), bar.b, tolerance=1e-8)
    x = sequence.solve(rigid.stretched(1.0), bar.b, tolerance=1e-8)
    assert _relative_residual(rigid.stretched(1.0), x, bar.b) < 1e-8
    assert sequence.factorisations == 2
    before = sequence.cg_iterations
    sequence.solve(rigid.stretched(1.01), bar.b, tolerance=1e-8)
    assert sequence.factorisations == 2
    assert sequence.cg_iterations > before


@pytest.mark.usefixtures("dear_factors")
def test_an_old_factor_serves_another_pattern_but_not_other_unknowns():
    bar, sequence = Bar(), SystemSequence(memory_limit=EVERYTHING)
    matrix = bar.stretched(1.0)
    sequence.solve(matrix, bar.b, free=bar.free)
    size = matrix.shape[0]
    ends = [0, 0, size - 1, size - 1], [0, size - 1, 0, size - 1]
    touching = sp.csr_matrix(matrix + sp.csr_matrix(([1.0, -1.0, -1.0, 1.0], ends)))
    assert touching[0, size - 1] != 0.0
    assert matrix[0, size - 1] == 0.0
    x = sequence.solve(touching, bar.b, tolerance=1e-6, free=bar.free)
    assert _relative_residual(touching, x, bar.b) < 1e-6
    assert sequence.factorisations == 1
    sequence.solve(matrix, bar.b, free=np.roll(bar.free, 3))
    assert sequence.factorisations == 2


@pytest.mark.usefixtures("dear_factors")
def test_the_same_systems_give_the_same_bits():
    bar = Bar()
    runs = []
    for _ in range(2):
        sequence = SystemSequence(memory_limit=EVERYTHING)
        solutions = [sequence.solve(bar.stretched(s), bar.b) for s in np.linspace(1.0, 1.1, 8)]
        runs.append((np.array(solutions), sequence.factorisations, sequence.cg_iterations))
    np.testing.assert_array_equal(runs[0][0], runs[1][0])
    assert runs[0][1:] == runs[1][1:]


@pytest.mark.usefixtures("dear_factors")
def test_by_the_clock_solutions_are_as_good():
    bar, sequence = Bar(), SystemSequence(memory_limit=EVERYTHING, by_clock=True)
    for s in (1.0, 1.05, 1.1):
        x = sequence.solve(bar.stretched(s), bar.b, tolerance=1e-6)
        assert _relative_residual(bar.stretched(s), x, bar.b) < 1e-6


@pytest.mark.usefixtures("dear_factors")
@pytest.mark.parametrize("limit", [EVERYTHING, NOTHING], ids=["factor", "multigrid"])
def test_indefinite_matrices_are_found_out_fresh_or_old_and_the_sequence_goes_on(limit):
    bar = Bar()
    good = bar.stretched(1.0)
    bad = sp.csr_matrix(good - 0.9 * sp.diags(good.diagonal()))
    fresh = SystemSequence(memory_limit=limit, rest=bar.rest)
    with pytest.raises(NotPositiveDefinite):
        fresh.solve(bad, bar.b, free=bar.free)
    x = fresh.solve(good, bar.b, tolerance=1e-6, free=bar.free)
    assert _relative_residual(good, x, bar.b) < 1e-6
    with pytest.raises(NotPositiveDefinite):
        fresh.solve(bad, bar.b, free=bar.free)


@pytest.mark.parametrize("limit", [EVERYTHING, NOTHING], ids=["factor", "multigrid"])
def test_a_system_without_solution_is_refused(limit):
    bar = Bar(3)
    everything = np.ones(bar.rest.size, dtype=bool)
    unconstrained = bar.body.hessian(bar.rest)
    push = np.tile([1.0, 0.0, 0.0], len(bar.rest))
    with pytest.raises((SingularMatrix, NotPositiveDefinite)):
        SystemSequence(memory_limit=limit, rest=bar.rest).solve(unconstrained, push, free=everything)


def test_ageing_renews_where_the_mean_cost_is_least():
    price = 36.0
    growing = [3 * k for k in range(1, 60)]  # iterations with a factor k solves old
    means = [(price + sum(growing[:k])) / (k + 1) for k in range(len(growing))]
    ageing, solves = Ageing(price), 0
    while not ageing.worn(0.1):
        ageing.used(growing[solves], 0.1)
        solves += 1
    assert means[solves] == pytest.approx(min(means), rel=0.02)


# Multigrid


@pytest.mark.parametrize(("poisson", "most"), [(0.3, 16), (0.45, 28), (0.48, 38), (0.49, 48)])
def test_multigrid_solves_what_does_not_fit(poisson, most):
    bar = Bar(6, poisson)
    sequence = SystemSequence(memory_limit=NOTHING, rest=bar.rest)
    matrix = bar.stretched(1.0)
    x = sequence.solve(matrix, bar.b, tolerance=1e-8, free=bar.free)
    np.testing.assert_allclose(x, spla.spsolve(matrix.tocsc(), bar.b), atol=1e-6 * np.abs(x).max())
    assert sequence.factorisations == 0
    assert 2 < sequence.cg_iterations < most
    sequence.solve(bar.stretched(1.02), bar.b, free=bar.free)
    assert sequence.work.multigrid_setups == 1


def test_multigrid_is_symmetric_and_positive():
    bar = Bar(4)
    cycle = Multigrid(bar.stretched(1.0), bar.free, bar.rest)
    u, v = np.random.default_rng(1).normal(size=(2, len(bar.b)))
    assert u @ cycle(v) == pytest.approx(v @ cycle(u), rel=1e-9)
    assert u @ cycle(u) > 0


def test_multigrid_takes_vertices_of_which_some_unknowns_are_fixed():
    bar = Bar(5)
    free = bar.free & (np.random.default_rng(2).random(bar.free.size) < 0.9)
    full = bar.body.hessian(bar.rest)
    matrix = FreeBlock(full, free).matrix(full)
    sequence = SystemSequence(memory_limit=NOTHING, rest=bar.rest)
    b = bar.b[: free.sum()]
    x = sequence.solve(matrix, b, tolerance=1e-8, free=np.flatnonzero(free))
    np.testing.assert_allclose(x, spla.spsolve(matrix.tocsc(), b), atol=1e-6 * np.abs(x).max())
    assert sequence.cg_iterations < 60


def test_multigrid_says_what_it_lacks():
    bar = Bar(2)
    with pytest.raises(InputError, match="rest"):
        SystemSequence(memory_limit=NOTHING).solve(bar.stretched(1.0), bar.b, free=bar.free)
    with pytest.raises(InputError, match="free"):
        SystemSequence(memory_limit=NOTHING, rest=bar.rest).solve(bar.stretched(1.0), bar.b)


# Conjugate gradients


def test_conjugate_gradients_end_in_as_many_iterations_as_eigenvalues():
    matrix = sp.diags(np.repeat([1.0, 4.0, 50.0], 20)).tocsr()
    b = np.random.default_rng(0).normal(size=60)
    found = conjugate_gradients(matrix, b, np.copy, 1e-10, 50)
    assert (found.end, found.count) == (End.CONVERGED, 3)
    np.testing.assert_allclose(matrix @ found.x, b, rtol=1e-9)


def test_conjugate_gradients_say_why_they_end():
    b = np.random.default_rng(0).normal(size=200)
    hard = sp.diags(np.geomspace(1, 1e8, 200)).tocsr()
    assert conjugate_gradients(hard, b, np.copy, 1e-10, 50).end is End.TOO_SLOW
    assert conjugate_gradients(hard, b, np.copy, 1e-10, 50).count < 15
    assert conjugate_gradients(hard, b, np.copy, 1e-10, 50, foretell=False).count == 50
    assert conjugate_gradients(-hard, b, np.copy, 1e-3, 50).end is End.NEGATIVE_CURVATURE
    assert conjugate_gradients(hard, b, np.negative, 1e-3, 50).end is End.INDEFINITE_PRECONDITIONER
    assert conjugate_gradients(hard, 0 * b, np.copy, 1e-3, 50).end is End.CONVERGED
