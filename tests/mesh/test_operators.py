import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from handpipe.mesh.tets.operators import (
    cotangent_laplacian,
    deformation_gradients,
    gradient_operator,
    mass_lumped,
    rest_inverses,
    tet_laplacian,
    tet_neighbours,
    vertex_volumes,
)
from handpipe.mesh.tets.tetrahedra import TetMesh

from .shapes import box_tets, sphere


def test_gradients_of_an_affine_map_are_exact():
    mesh = box_tets(3)
    matrix = np.random.default_rng(0).normal(size=(3, 3))
    x = mesh.vertices @ matrix.T + [1.0, -2.0, 3.0]
    expected = np.broadcast_to(matrix, (len(mesh.tets), 3, 3))
    from_operator = (gradient_operator(mesh.vertices, mesh.tets) @ x.ravel()).reshape(-1, 3, 3)
    np.testing.assert_allclose(from_operator, expected, atol=1e-12)
    inverses = rest_inverses(mesh.vertices, mesh.tets)
    np.testing.assert_allclose(deformation_gradients(inverses, x, mesh.tets), expected, atol=1e-12)


def test_operator_and_kernel_agree_on_any_positions():
    mesh = box_tets(3)
    x = np.random.default_rng(1).normal(size=mesh.vertices.shape)
    from_operator = (gradient_operator(mesh.vertices, mesh.tets) @ x.ravel()).reshape(-1, 3, 3)
    kernel = deformation_gradients(rest_inverses(mesh.vertices, mesh.tets), x, mesh.tets)
    np.testing.assert_allclose(kernel, from_operator, atol=1e-10)


def test_tet_laplacian_is_that_of_the_graph_of_faces():
    mesh = box_tets(3)
    laplacian = tet_laplacian(mesh.tets)
    faces = {}
    for e, tet in enumerate(mesh.tets):
        for left_out in tet:
            faces.setdefault(frozenset(set(tet) - {left_out}), []).append(e)
    pairs = {tuple(sorted(owners)) for owners in faces.values() if len(owners) == 2}
    assert {tuple(sorted(p)) for p in tet_neighbours(mesh.tets)} == pairs
    dense = laplacian.toarray()
    assert np.abs(dense.sum(axis=1)).max() == 0
    assert (dense == dense.T).all()
    assert {(i, j) for i, j in np.argwhere(dense == -1) if i < j} == pairs
    assert connected_components(laplacian)[0] == 1


def test_two_bodies_do_not_touch_in_the_tet_laplacian():
    tets = box_tets(1).tets
    apart = np.concatenate([tets, tets + 8])
    assert connected_components(tet_laplacian(apart))[0] == 2


def test_cotangent_laplacian_of_the_sphere_has_its_eigenvalue():
    shape = sphere(2.0, 4)
    laplacian = cotangent_laplacian(shape.vertices, shape.triangles)
    mass = mass_lumped(shape.vertices, shape.triangles)
    z = shape.vertices[:, 2]  # the first harmonic: eigenvalue 2 / r^2
    assert np.abs(laplacian @ np.ones(len(z))).max() < 1e-10
    assert z @ (laplacian @ z) / (z @ (mass * z)) == pytest.approx(0.5, rel=2e-3)


def test_masses_add_up():
    mesh = box_tets(3)
    assert vertex_volumes(mesh).sum() == pytest.approx(1)
    assert mass_lumped(sphere(3).vertices, sphere(3).triangles).sum() == pytest.approx(sphere(3).area())
    corner = vertex_volumes(TetMesh(mesh.vertices, mesh.tets[:1]))
    assert corner[mesh.tets[0]] == pytest.approx(mesh.volumes()[0] / 4)
