"""No minimum with a barrier has inverted tets; without need of one nothing changes."""

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box

from handpipe.core.errors import ConvergenceError
from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements.crushing import CRUSHED
from handpipe.fem.elements.materials import Material
from handpipe.fem.elements.validity import Validity
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.solver import equilibrium
from handpipe.fem.solver.equilibrium import Options

REST, TETS = box((4.0, 2.0, 2.0), (4, 2, 2))
BODY = Elastic(REST, TETS, Material(1.0, 0.48))


def _held(spring, shift):
    """Springs on the layers x = 0 and x = 1, which hold them `shift` mm nearer than at rest."""
    ids = np.flatnonzero(REST[:, 0] < 1.5)
    matrix = sp.csr_matrix((np.ones(len(ids)), (np.arange(len(ids)), ids)), shape=(len(ids), len(REST)))
    nearer = np.where(REST[ids, :1] > 0.5, -shift, 0.0) * [1.0, 0.0, 0.0]
    return Attachment(matrix, REST[ids] + nearer, spring)


def _ratios(x):
    edges = [v[TETS[:, 1:]] - v[TETS[:, :1]] for v in (REST, x)]
    return np.linalg.det(edges[1]) / np.linalg.det(edges[0])


@pytest.mark.parametrize("untangle", [False, True])
def test_layers_that_springs_pull_through_one_another_stay_apart(untangle):
    springs = _held(20.0, 1.4)
    without = equilibrium.solve([BODY, springs], REST, options=Options(untangle=False))
    assert (_ratios(without.x) < 0).any()
    found = equilibrium.solve([BODY, springs], REST, options=Options(untangle=untangle, barrier=True))
    ratios = _ratios(found.x)
    assert 0 < ratios.min() < CRUSHED
    forces = BODY.gradient(found.x) + springs.gradient(found.x)
    crushed = np.isin(np.arange(len(REST)), TETS[ratios < CRUSHED])
    largest = np.linalg.norm(springs.gradient(found.x), axis=1).max()
    assert np.linalg.norm(forces[~crushed], axis=1).max() < 1e-4 * largest
    assert np.linalg.norm(forces[crushed], axis=1).max() > 1e-2 * largest


def test_the_shape_does_not_depend_on_the_start():
    springs, options = _held(20.0, 1.4), Options(untangle=False, barrier=True)
    rng, found = np.random.default_rng(0), []
    for start in (REST, REST + rng.normal(0.0, 0.1, REST.shape), REST * [0.3, 1.0, 1.0]):
        found.append(equilibrium.solve([BODY, springs], start, options=options).x)
    np.testing.assert_allclose(found[1], found[0], atol=1e-4)
    np.testing.assert_allclose(found[2], found[0], atol=1e-4)


def test_a_body_that_is_nowhere_crushed_is_the_same_with_and_without():
    springs = _held(20.0, 0.3)
    plain = equilibrium.solve([BODY, springs], REST)
    found = equilibrium.solve([BODY, springs], REST, options=Options(barrier=True))
    assert _ratios(found.x).min() > CRUSHED
    np.testing.assert_array_equal(found.x, plain.x)
    assert found.record.iterations == plain.record.iterations


def test_prescribed_vertices_that_invert_a_tet_are_an_error_with_the_place():
    fixed = np.repeat(REST[:, 0] < 1.5, 3)
    start = np.where(REST[:, :1] == 1.0, REST - [1.5, 0.0, 0.0], REST)
    match = r"24 of 96 tets are inverted, the worst at \(-?0\.\d, "
    with pytest.raises(ConvergenceError, match=match) as error:
        equilibrium.solve([BODY], start, fixed=fixed, options=Options(barrier=True))
    assert "det F = -0.5" in str(error.value)


def test_validity_names_the_worst_tet_and_the_bone_beside_it():
    x = REST.copy()
    x[np.argmax(REST.sum(axis=1))] -= 3.0
    ratios = _ratios(x)
    found = Validity.check(REST, TETS, x)
    assert found.figures == {"inverted_tets": (ratios <= 0).sum(), "least_det": pytest.approx(ratios.min())}
    bones = {"far": REST + 50.0, "near": found.place + [[0.0, 0.0, 2.5]]}
    with pytest.raises(ConvergenceError, match=r"fat of fist .* det F = -.*, 2\.5 mm from near"):
        found.require("fat of fist", bones)
    Validity.check(REST, TETS, REST).require("fat of fist", bones)


def test_a_position_that_is_no_number_is_inverted():
    x = REST.copy()
    x[0] = np.nan
    assert Validity.check(REST, TETS, x).inverted == (TETS == 0).any(axis=1).sum()
