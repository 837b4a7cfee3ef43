"""Orders of convergence in a smooth, large deformation: two for linear, near three for quadratic elements."""

import numpy as np
import pytest
from tests.fem.bodies import box

from handpipe.fem.elements.materials import Material
from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.continuum.solid import Solid
from handpipe.synthetic.coupled.validation import observed_order

TIGHT = Options(displacement_tolerance=1e-9, force_tolerance=1e-9)
POINTS = np.random.default_rng(0).uniform(0.05, 0.95, (300, 3))


def _at_points(order, cells, poisson=0.3):
    """Positions of POINTS in a unit cube whose faces are bent into waves."""
    mesh = TetMesh(*box((1.0, 1.0, 1.0), (cells, cells, cells)))
    elements = Elements.quadratic(mesh) if order == 2 else Elements.linear(mesh)
    x = elements.nodes
    outer = ((x < 1e-9) | (x > 1 - 1e-9)).any(axis=1)
    bent = x + 0.1 * np.sin(2 * x[:, [1, 2, 0]])
    body = Solid(elements, Material(1.0, poisson))
    return elements.interpolation(POINTS) @ solve([body], bent, fixed=np.repeat(outer, 3), options=TIGHT).x


@pytest.mark.parametrize("order, least", [(1, 1.8), (2, 2.5)])
def test_errors_fall_with_the_order(order, least):
    reference = _at_points(2, 8)
    errors = [np.sqrt(((_at_points(order, n) - reference) ** 2).mean()) for n in ((4, 8), (2, 4))[order - 1]]
    assert observed_order(errors) > least
