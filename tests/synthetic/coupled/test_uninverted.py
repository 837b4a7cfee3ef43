"""A single tet pressed harder than its resistance bears before it is inside out."""

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.fem.bodies import box

from handpipe.core.errors import ConvergenceError
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.continuum.crushing import CRUSHED
from handpipe.synthetic.coupled import uninverted as module
from handpipe.synthetic.coupled.coupled_body import CRUSH_STIFFNESS, CoupledAnatomy, CoupledBody, CoupledPose
from handpipe.synthetic.coupled.element_repair import repair_elements
from handpipe.synthetic.coupled.uninverted import uninverted

FORCE = 1500.0  # mN
OPTIONS = Options(displacement_tolerance=1e-9, force_tolerance=1e-9, untangle=False)


@pytest.fixture
def pressed():
    """The unit tet of fat, three corners on a bone, the fourth pressed through them."""
    mesh = TetMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]))
    anatomy = CoupledAnatomy(mesh, np.zeros(1, dtype=int), ("fat",), {"bone": np.array([0, 1, 2])})
    body = CoupledBody(anatomy, {"fat": Material(10.0, 0.3)}, order=1)
    top = np.eye(4)[3:]
    energies = [*body.energies(CoupledPose({})), Pull(top, np.array([[0.0, 0.0, -FORCE]]))]
    return body, energies, solve(energies, body.rest, fixed=body.fixed, options=OPTIONS)


def test_what_ends_inside_out_comes_to_rest_the_right_way_out(pressed):
    """Its height is det F, of which the logarithm's slope bears the force."""
    body, energies, found = pressed
    assert body.inverted(found.x)
    height = uninverted(body, energies, found, OPTIONS).x[3, 2]

    def force(j):
        s = j / CRUSHED
        slope = -2 * (s - 1) * np.log(s) - (s - 1) ** 2 / s
        return -CRUSH_STIFFNESS / 6 / CRUSHED * slope - FORCE

    assert height == pytest.approx(brentq(force, 1e-4, 0.3), rel=0.01)


def test_what_is_pressed_harder_than_the_first_resistance_bears_resists_further(pressed):
    """Where the logarithm ends at 2e-3 it bears 5.6 N, so that 20 N need more than one try."""
    body, energies, _ = pressed
    harder = [*energies[:-1], Pull(np.eye(4)[3:], np.array([[0.0, 0.0, -20_000.0]]))]
    found = solve(harder, body.rest, fixed=body.fixed, options=OPTIONS)
    assert body.inverted(found.x)
    assert uninverted(body, harder, found, OPTIONS).x[3, 2] > 0


def test_what_is_the_right_way_out_is_not_touched(pressed):
    body, energies, found = pressed
    resting = solve(energies[:-1], body.rest, fixed=body.fixed, options=OPTIONS)
    assert uninverted(body, energies[:-1], resting, OPTIONS) is resting


def test_what_stays_inside_out_is_an_error(pressed, monkeypatch):
    body, energies, found = pressed
    monkeypatch.setattr(module, "solve", lambda *_, **__: found)
    with pytest.raises(ConvergenceError, match=r"inside out, first at \(.*\) in fat"):
        uninverted(body, energies, found, OPTIONS)


def test_a_quadratic_tet_that_folds_beside_its_points_unfolds():
    """The middle of a free edge is pulled through the tet: its points do not feel it."""
    mesh = TetMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]))
    anatomy = CoupledAnatomy(mesh, np.zeros(1, dtype=int), ("fat",), {"bone": np.array([0, 1, 2])})
    body = CoupledBody(anatomy, {"fat": Material(10.0, 0.3)})
    middle = np.flatnonzero((body.rest == [0.0, 0.0, 0.5]).all(axis=1))
    row = np.eye(len(body.rest))[middle]
    energies = [*body.energies(CoupledPose({})), Pull(row, np.array([[20.0, 20.0, 0.0]]))]
    found = solve(energies, body.rest, fixed=body.fixed, options=OPTIONS)
    assert (body.solid.volume_ratios(found.x) > 0).all() and body.folded(found.x).all()
    unfolded = uninverted(body, energies, found, OPTIONS).x
    assert body.inverted(unfolded) == 0
    assert unfolded[middle, 0] > 0.1


def pulled_bar(force):
    """A bar of fat on a bone, the middle of an edge pulled through the tets beside it: at rest so, folded."""
    mesh = TetMesh(*box((8.0, 2.0, 2.0), (8, 2, 2)))
    end = np.flatnonzero(mesh.vertices[:, 0] == 0)
    anatomy = CoupledAnatomy(mesh, np.zeros(len(mesh.tets), dtype=int), ("fat",), {"bone": end})
    body = CoupledBody(anatomy, {"fat": Material(10.0, 0.3)})
    middle = np.flatnonzero(np.isclose(body.rest, [4.5, 0.0, 0.0]).all(axis=1))
    row = np.eye(len(body.rest))[middle]
    energies = [*body.energies(CoupledPose({})), Pull(row, np.array([[0.0, force, force]]))]
    return body, energies, solve(energies, body.rest, fixed=body.fixed, options=OPTIONS)


def test_a_folded_place_is_taken_from_a_shape_that_is_not():
    """A bar sheared along itself, which is a harmonic field, and a node pulled through the tets about it."""
    mesh = TetMesh(*box((20.0, 2.0, 2.0), (20, 2, 2)))
    anatomy = CoupledAnatomy(mesh, np.zeros(len(mesh.tets), dtype=int), ("fat",), {"bone": np.array([0])})
    body = CoupledBody(anatomy, {"fat": Material(10.0, 0.3)})
    sheared = body.rest + 0.05 * body.rest[:, :1] * [0.0, 0.0, 1.0]
    folded = sheared.copy()
    folded[np.isclose(body.rest, [10.5, 0.0, 0.0]).all(axis=1)] += [0.0, 1.5, 1.5]
    assert body.inverted(folded) > 0
    x, taken = repair_elements(body, folded, body.rest)
    assert 0 < taken.sum() < 0.8 * len(x)
    np.testing.assert_allclose(x, sheared, atol=1e-12)
    assert repair_elements(body, folded, folded) is None


@pytest.mark.parametrize("force", [20.0, 30.0, 60.0])
def test_from_a_valid_shape_an_equilibrium_without_inverted_elements_is_found(force):
    """Not always that which is found without one: the bar has several, and rounding decides between them.

    Beyond the place that is pulled, where nothing is crushed, the forces of tissue balance.
    """
    body, energies, found = pulled_bar(force)
    for right in (body.rest, None):
        x = uninverted(body, energies, found, OPTIONS, right).x
        assert body.inverted(x) == 0
        unbalanced = np.sum([energy.gradient(x) for energy in energies], axis=0).reshape(-1, 3)
        assert np.abs(unbalanced[body.rest[:, 0] > 6.0]).max() < 1e-6 * force


@pytest.mark.parametrize("force", [20.0, 60.0])
def test_what_turns_in_its_surroundings_leaves_little_to_the_whole_body(force, monkeypatch):
    """The middle of a bar's edge is pulled through the tets beside it. Where it ends is the same without."""
    body, energies, found = pulled_bar(force)
    assert body.folded(found.x).sum() >= 2
    turned = uninverted(body, energies, found, OPTIONS)
    monkeypatch.setattr(module, "_turned", lambda body, energies, moving, x, options: x)
    at_once = uninverted(body, energies, found, OPTIONS)
    assert body.inverted(turned.x) == 0
    np.testing.assert_allclose(turned.x, at_once.x, atol=1e-7)
    alone, whole = (r.record.iterations - found.record.iterations for r in (turned, at_once))
    assert alone <= whole / 3
