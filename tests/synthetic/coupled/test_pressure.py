"""Muscles that keep their volume, by a pressure on their surface."""

import numpy as np
import pytest
from benchmarks.truth import toy

from handpipe.core.errors import ConvergenceError
from handpipe.fem.elements.materials import Material
from handpipe.fem.solver.equilibrium import Options
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.coupled import pressure
from handpipe.synthetic.coupled.coupled_body import CoupledBody
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.pressure import KEPT, with_volumes_kept
from handpipe.synthetic.coupled.validation import volume_changes

OPTIONS = Options(displacement_tolerance=1e-7, force_tolerance=1e-8)
SOFT = {**toy.MATERIALS, "flexor": Material(6.0, 0.45)}  # loses volume under its own tension
POSE = toy.hinge(np.radians(30.0))


@pytest.fixture(scope="module")
def body():
    return CoupledBody(toy.finger(6.5), SOFT, order=1)


@pytest.fixture(scope="module")
def without(body):
    return follow(body, lambda t: toy.hinge(np.radians(30.0) * t), options=OPTIONS).x


def test_volume_is_kept_by_a_pressure_on_the_muscles_surface(body, without):
    assert abs(volume_changes(body, without)["flexor"]) > 1.0  # percent
    x = with_volumes_kept(body, POSE, without, OPTIONS).x
    assert abs(volume_changes(body, x)["flexor"]) < 100 * KEPT
    # Without the pressure's force there is no equilibrium; it is that of one pressure on the closed surface.
    forces = sum(p.gradient(x) for p in body.potentials(POSE)).ravel()[~body.fixed]
    tets = body.cells.tets[body.cell_labels == body.anatomy.regions.index("flexor")]
    triangles = TetMesh(x, tets).boundary().triangles
    areas = 0.5 * np.cross(x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]])
    measure = np.zeros_like(x)
    np.add.at(measure, triangles, areas[:, None] / 3)
    measure = measure.ravel()[~body.fixed]
    multiplier = measure @ forces / (measure @ measure)
    assert abs(multiplier) > 0.1  # kPa
    assert np.linalg.norm(forces - multiplier * measure) < 1e-5 * np.linalg.norm(forces)


def test_volumes_that_are_not_met_are_refused(body, without, monkeypatch):
    monkeypatch.setattr(pressure, "ROUNDS", 1)
    with pytest.raises(ConvergenceError, match="volume"):
        with_volumes_kept(body, POSE, without, OPTIONS)
