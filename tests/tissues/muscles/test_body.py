"""The tetrahedra that carry a body, thin ones too."""

import numpy as np
import pytest
import trimesh

from handpipe.mesh.contact.self_cuts import cuts_itself
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.geometry.tubes import sweep
from handpipe.tissues.muscles.fitting.soft_body import SoftBody


def string(radius: float) -> Surface:
    """A round muscle of 40 mm with thin ends."""
    x = np.linspace(0, 40, 81)
    line = np.column_stack([x, 3 * np.sin(x / 12), np.zeros_like(x)])
    return remesh(Surface(*sweep(line, radius)), 0.45 * radius)


@pytest.mark.parametrize("radius", [1.2, 1.6, 4.0])
def test_the_cage_keeps_the_volume_of_a_thin_muscle(radius):
    surface = string(radius)
    x = surface.vertices[:, 0]
    body = SoftBody.fill(surface, {"a": np.flatnonzero(x < 3), "b": np.flatnonzero(x > 37)}, 1.8)
    assert body.mesh.volumes().sum() == pytest.approx(surface.volume(), rel=0.15)
    assert not cuts_itself(body.mesh.boundary().compact())
    np.testing.assert_allclose(body.surface_at(body.mesh.vertices).vertices, surface.vertices, atol=1e-9)


def ribbon(thickness: float) -> Surface:
    """A muscle of 40 mm that is rolled up lengthwise to a third of a gap."""
    radius, share = 1.3, 0.7
    sheet = trimesh.creation.box((40.0, 2 * np.pi * radius * share, thickness)).subdivide_to_size(0.5)
    x, y, z = sheet.vertices.T
    around = np.column_stack([np.sin(y / radius), np.cos(y / radius)]) * (radius + z)[:, None]
    return Surface(np.column_stack([x, around]), sheet.faces)


def test_a_cage_that_cuts_itself_is_made_of_shorter_edges():
    cut = 0
    for thickness in (0.45, 0.5, 0.55):
        surface = ribbon(thickness)
        cut += cuts_itself(remesh(surface, 0.8).largest_component())
        body = SoftBody.fill(surface, {"a": np.flatnonzero(surface.vertices[:, 0] < -17)}, 1.6)
        assert not cuts_itself(body.mesh.boundary().compact())
        assert body.mesh.volumes().min() > 0
    assert cut > 0  # else nothing was asked
