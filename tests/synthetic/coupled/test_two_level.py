"""Quadratic tets solved by two levels: a preconditioner that is one, and equilibria as by factors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from benchmarks.truth import toy
from numpy.testing import assert_allclose

from handpipe.core.errors import InputError
from handpipe.fem.linear.conjugate_gradients import End, conjugate_gradients
from handpipe.fem.linear.factorisation import NotPositiveDefinite
from handpipe.fem.linear.system_sequence import SystemSequence
from handpipe.fem.linear.two_level import TwoLevel, with_nodes
from handpipe.fem.minimisation import newton
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials.potential import Sum
from handpipe.fem.solver.equilibrium import solve
from handpipe.synthetic.coupled.coupled_body import CoupledBody
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.pressure import with_volumes_kept
from handpipe.synthetic.template_hands import coupled_hand

POSE = toy.hinge(np.radians(25.0))


@pytest.fixture(scope="module")
def body() -> CoupledBody:
    return CoupledBody(toy.finger(6.5), toy.MATERIALS)


def system(body: CoupledBody) -> tuple[sp.csr_matrix, np.ndarray]:
    """The Hessian's block of the unknowns at rest, and a force."""
    free = ~body.fixed
    matrix = FreeBlock(h := Sum(body.potentials(POSE)).hessian(body.rest), free).matrix(h)
    return matrix, np.random.default_rng(0).normal(size=matrix.shape[0])


def test_linear_fields_come_to_the_nodes(body):
    matrix, offset = np.random.default_rng(1).normal(size=(3, 3)), [1.0, 2.0, 3.0]
    at = body.anatomy.mesh.vertices @ matrix + offset
    assert_allclose(body.elements.prolongation() @ at, body.rest @ matrix + offset, atol=1e-9)
    linear = CoupledBody(body.anatomy, toy.MATERIALS, order=1).elements.prolongation()
    assert abs(linear - sp.eye(len(at))).max() == 0


def test_the_cycle_is_symmetric_and_positive(body):
    matrix, _ = system(body)
    cycle = TwoLevel(matrix, ~body.fixed, body.elements.prolongation())
    a, b = np.random.default_rng(2).normal(size=(2, matrix.shape[0]))
    assert a @ cycle(b) == pytest.approx(b @ cycle(a), rel=1e-9)
    assert a @ cycle(a) > 0 and b @ cycle(b) > 0


def test_iterations_do_not_grow_with_the_mesh(body):
    """Without a coarse space they double with each halving of edges."""
    counts = []
    for one in (body, CoupledBody(body.anatomy.refined(), toy.MATERIALS)):
        matrix, force = system(one)
        cycle = TwoLevel(matrix, ~one.fixed, one.elements.prolongation())
        found = conjugate_gradients(matrix, force, cycle, 1e-8, 400, False)
        assert found.end is End.CONVERGED
        assert_allclose(matrix @ found.x, force, atol=1e-6 * np.abs(force).max())
        counts.append(found.count)
    assert counts[1] < 1.4 * counts[0]


def test_single_stiff_nodes_in_the_coarse_space_cost_nothing(body):
    matrix, force = system(body)
    free = ~body.fixed
    stiff = np.flatnonzero(free.reshape(-1, 3)[:, 0])[-40:]
    bent = np.random.default_rng(3).normal(size=(3 * len(stiff), 3 * len(stiff)))
    numbers = (np.cumsum(free) - 1).reshape(-1, 3)[stiff].ravel()
    spread = sp.csr_matrix(
        (np.ones(len(numbers)), (numbers, np.arange(len(numbers)))), (matrix.shape[0], len(numbers))
    )
    stiffened = sp.csr_matrix(matrix + 1e4 * spread @ sp.csr_matrix(bent @ bent.T) @ spread.T)
    carry = body.elements.prolongation()
    counts = [
        conjugate_gradients(stiffened, force, TwoLevel(stiffened, free, p), 1e-6, 2000, False).count
        for p in (carry, with_nodes(carry, stiff))
    ]
    easy = conjugate_gradients(matrix, force, TwoLevel(matrix, free, carry), 1e-6, 2000, False)
    assert counts[1] < 1.1 * easy.count and counts[0] > 1.4 * easy.count
    assert with_nodes(carry, np.arange(5)).shape == carry.shape


def test_nodes_that_are_held_in_part_are_refused(body):
    free = ~body.fixed
    matrix, _ = system(body)
    free[np.flatnonzero(free)[0]] = False
    with pytest.raises(InputError, match="holds some nodes in some directions only"):
        TwoLevel(matrix[1:, 1:], free, body.elements.prolongation())


def test_where_the_energy_curves_down_a_step_ends_in_a_direction_of_descent(body):
    """Without a coarse space such a matrix is refused; with it, what was found before is handed on."""
    matrix, force = system(body)
    soft = np.sort(sp.linalg.eigsh(matrix, 3, sigma=0, return_eigenvectors=False))
    bent = sp.csr_matrix(matrix - 0.5 * (soft[0] + soft[1]) * sp.eye(len(force)))
    systems = SystemSequence(rest=body.rest, coarse=body.elements.prolongation())
    step = systems.solve(matrix, force, free=~body.fixed)
    assert_allclose(matrix @ step, force, atol=2e-3 * np.linalg.norm(force))
    step = systems.solve(bent, force, free=~body.fixed, tolerance=1e-10)
    assert force @ step > 0
    with pytest.raises(NotPositiveDefinite):
        SystemSequence(rest=body.rest).solve(bent, force, free=~body.fixed)


DEGREES = {"neutral": 0.0, "less": 15.0, "bent": 25.0}


def test_a_hand_of_quadratic_tets_ends_where_it_does_when_followed_by_factors(body, monkeypatch):
    """The toy in place of the hand: from rest in steps with a factor, and from linear tets by two levels."""

    class Hand(SimpleNamespace):
        quadratic = True

        def pose(self, bones):
            return bones

        def linear(self):
            return Hand(body=CoupledBody(body.anatomy, toy.MATERIALS, order=1), quadratic=False)

    def bones_at(motion, pose, share=1.0, start="neutral"):
        before, after = (motion.poses[name]["flexion"] for name in (start, pose))
        return toy.hinge(np.radians(before + share * (after - before)))

    monkeypatch.setattr(coupled_hand, "bones_at", bones_at)
    motion = SimpleNamespace(poses={n: {"flexion": d} for n, d in DEGREES.items()})
    found = coupled_hand.settle(Hand(body=body), motion, "bent")
    options = coupled_hand.AT_REST
    reached = follow(body, lambda t: bones_at(motion, "bent", t), steps=5, options=options).x
    known = with_volumes_kept(body, POSE, reached, options).x
    assert np.abs(found - known).max() < 5e-3
    assert np.abs(known - body.rest).max() > 5.0
    pose, errors = coupled_hand.refinement_errors(
        Hand(body=body), motion, {"neutral": body.rest, "bent": found}
    )
    assert pose == "bent" and 0.05 < errors["hand"]["rms"][0] < errors["hand"]["max"][0] < 2.0
    begun = []
    monkeypatch.setattr(coupled_hand, "_other_start", lambda body, x, right: begun.append((right, x)) or x)
    less = coupled_hand.settle(Hand(body=body), motion, "less")
    one, other, apart = coupled_hand.start_difference(Hand(body=body), motion, {"less": less, "bent": found})
    assert (one, other) == ("less", "bent") and apart < 5e-3
    [(linear, other_start)] = begun
    assert np.abs(other_start - linear).max() > 0.05 < np.abs(other_start - found).max()  # elsewhere


def test_forces_at_rest_are_met_without_digits_that_nobody_asked_for(body, monkeypatch):
    """Two levels pay for each digit of a linear system."""
    linear, carry = CoupledBody(body.anatomy, toy.MATERIALS, order=1), body.elements.prolongation()
    coarse = follow(linear, lambda t: toy.hinge(t * np.radians(25.0)), steps=5).x
    start, found = body.prescribed(POSE, carry @ coarse), []
    options = replace(coupled_hand.AT_REST, coarse=carry, max_step=1.0)
    for spare in (newton.SPARE, 0.0):
        monkeypatch.setattr(newton, "SPARE", spare)
        found.append(solve(body.energies(POSE), start, fixed=body.fixed, options=options))
    assert all(f.record.converged for f in found)
    assert np.abs(found[0].x - found[1].x).max() < 1e-3
    assert found[0].record.cg_iterations < found[1].record.cg_iterations
