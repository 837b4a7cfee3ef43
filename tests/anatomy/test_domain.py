"""The space between skin and bones, and finer tets in it."""

import numpy as np
import pytest
from tests.anatomy.arm import arm
from tests.anatomy.meshes import euler_characteristic, require_conforming

from handpipe.anatomy.templates.domain import Domain
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.embedding import Locator
from handpipe.mesh.tets.tetrahedra import EDGES


@pytest.fixture(scope="module")
def limb() -> tuple[Domain, Surface, dict[str, Surface]]:
    skin, bones = arm(5.0)
    return Domain.between(skin, bones, 5.0), skin, bones


def test_surfaces_are_kept_and_named(limb: tuple[Domain, Surface, dict[str, Surface]]) -> None:
    domain, skin, bones = limb
    assert np.array_equal(domain.mesh.vertices[domain.skin], skin.vertices)
    assert np.array_equal(domain.mesh.vertices[domain.bones["radius"]], bones["radius"].vertices)
    assert len(domain.mesh.boundary_vertices()) == len(domain.skin) + len(domain.bones["radius"])
    np.testing.assert_allclose(domain.mesh.volumes().sum(), skin.volume() - bones["radius"].volume())


def test_tets_are_found_around_points(limb: tuple[Domain, Surface, dict[str, Surface]]) -> None:
    domain = limb[0]
    middles = domain.mesh.vertices[domain.mesh.tets].mean(axis=1)
    locator = Locator(domain.mesh)
    assert np.array_equal(locator.tets(middles), np.arange(len(middles)))
    assert np.array_equal(locator.tets(np.array([[0.0, 0, 0], [0, 0, 30]])), [-1, -1])


def test_finer_tets_along_a_line(limb: tuple[Domain, Surface, dict[str, Surface]]) -> None:
    domain, skin, bones = limb
    line = np.column_stack([np.linspace(-25, 25, 100), np.zeros(100), np.linspace(-5, -19, 100)])
    fine = domain.refined(line, 1.5)
    mesh, before = fine.mesh, domain.mesh
    require_conforming(mesh, before.boundary().area())
    assert euler_characteristic(mesh) == euler_characteristic(before)
    assert np.array_equal(mesh.vertices[: len(before.vertices)], before.vertices)
    np.testing.assert_allclose(mesh.volumes().sum(), before.volumes().sum())
    near = Locator(mesh).tets(line)
    ends = mesh.vertices[mesh.tets[near[near >= 0]][:, EDGES]]
    assert np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max() < 1.4 * (1.5 + 0.6 * 1.5)
    assert mesh.smallest_dihedral() > 0.3 * before.smallest_dihedral()
    assert len(mesh.tets) < 20 * len(before.tets)
    for own, surface in ((fine.skin, skin), (fine.bones["radius"], bones["radius"])):
        assert len(own) > len(surface.vertices)
        assert Distance(surface).closest(mesh.vertices[own])[0].max() < 1e-9
    on_boundary = np.concatenate([fine.skin, fine.bones["radius"]])
    assert np.array_equal(np.sort(on_boundary), mesh.boundary_vertices())
