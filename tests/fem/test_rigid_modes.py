"""Rigid motions that nothing resists are found and fixed, and no others."""

import numpy as np
import pytest
from tests.tissues.muscles.shapes import box

from handpipe.core.rigid import RigidTransform
from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.elements.materials import Material
from handpipe.fem.minimisation import rigid_modes
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.potential import Sum
from handpipe.fem.solver import equilibrium

MESH = box((4, 2, 2), (12.0, 4.0, 4.0))


def body() -> Elastic:
    logs = 0.02 * MESH.vertices[MESH.tets].mean(axis=1) @ np.random.default_rng(0).standard_normal((3, 6))
    return Elastic(MESH.vertices, MESH.tets, Material(6.0, 0.48), plasticity.exp(logs))


@pytest.mark.parametrize(("ids", "count"), [([], 6), ([0, 1, 5, 30], 0)])
def test_as_many_pins_as_motions_that_springs_leave(ids: list[int], count: int) -> None:
    x, parts = MESH.vertices, [body()]
    if ids:
        matrix = np.eye(len(x))[ids]
        parts.append(Attachment(matrix, x[ids], 10.0))
    energy = Sum(parts)
    found = rigid_modes.pins(energy, energy.hessian(x), x, np.ones(x.size, dtype=bool))
    assert len(found) == count


def test_a_free_body_ends_near_its_start_without_escapes() -> None:
    found = equilibrium.solve([body()], MESH.vertices)
    again = equilibrium.solve([body()], found.x + 1e-3)
    assert found.record.escapes == again.record.escapes == 0
    assert again.x == pytest.approx(found.x + 1e-3, abs=1e-6)
    other = RigidTransform.about(np.zeros(3), np.diag([-1.0, -1.0, 1.0]))
    turned = equilibrium.solve([body()], other(MESH.vertices))
    assert body().value(turned.x) == pytest.approx(body().value(found.x), rel=1e-6)
