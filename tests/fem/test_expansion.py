"""An energy's second-order expansion about a state, against the energy."""

import numpy as np
import pytest
from tests.fem.bodies import box

from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.expansion import Expansion


def test_it_is_the_energy_up_to_third_order_in_the_moves_of_its_nodes():
    vertices, tets = box((3.0, 2.0, 2.0), (3, 2, 2))
    body, rng = Elastic(vertices, tets, Material(6.0, 0.4)), np.random.default_rng(0)
    x = vertices + 0.05 * rng.normal(size=vertices.shape)
    nodes = vertices[:, 0] > 1.5
    near, moves = Expansion([body], x, nodes), rng.normal(size=(nodes.sum(), 3))
    missed = []
    for size in (1e-2, 5e-3):
        moved = x.copy()
        moved[nodes] += size * moves
        missed.append(body.value(moved) - body.value(x) - near.value(x[nodes] + size * moves))
        slope = (near.gradient(x[nodes] + size * moves) * moves).sum()
        step = 1e-6 * moves
        central = near.value(x[nodes] + size * moves + step) - near.value(x[nodes] + size * moves - step)
        assert slope == pytest.approx(central / 2e-6, rel=1e-5)
    assert missed[0] / missed[1] == pytest.approx(8.0, rel=0.1)
    assert near.value(x[nodes]) == 0.0
