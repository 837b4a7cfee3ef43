import numpy as np
import pytest

from handpipe.mesh.tets.embedding import Embedding

from .shapes import box_tets


@pytest.fixture(scope="module")
def mesh():
    return box_tets(3)


def test_affine_maps_are_reproduced_inside_and_outside(mesh):
    points = np.random.default_rng(0).uniform(-0.5, 1.5, (400, 3))
    embedding = Embedding.embed(points, mesh)
    matrix = np.random.default_rng(1).normal(size=(3, 3))
    moved = embedding(mesh.vertices @ matrix.T + 5)
    np.testing.assert_allclose(moved, points @ matrix.T + 5, atol=1e-10)
    np.testing.assert_allclose(embedding.weights.sum(axis=1), 1)


def test_a_point_inside_lies_in_its_tet(mesh):
    points = np.random.default_rng(2).uniform(0, 1, (400, 3))
    assert Embedding.embed(points, mesh).weights.min() > -1e-9


def test_a_point_outside_follows_the_face_next_to_it(mesh):
    embedding = Embedding.embed(np.array([[0.4, 0.45, 1.1]]), mesh)
    assert np.abs(mesh.vertices[embedding.cells[0]] - [0.4, 0.45, 1.1]).max() < 0.5
    assert (mesh.vertices[embedding.cells[0]][:, 2] == 1).sum() == 3


def test_points_drawn_in_lie_in_the_mesh(mesh):
    points = np.random.default_rng(4).uniform(-0.5, 1.5, (400, 3))
    inside = ((points > 0) & (points < 1)).all(axis=1)
    embedding = Embedding.embed(points, mesh)
    drawn = embedding.drawn_in()(mesh.vertices)
    np.testing.assert_allclose(drawn[inside], points[inside], atol=1e-9)
    assert drawn.min() > -1e-9 and drawn.max() < 1 + 1e-9
    np.testing.assert_allclose(embedding.chosen(np.arange(5))(mesh.vertices), points[:5], atol=1e-9)


def test_vertices_are_embedded_in_themselves(mesh):
    embedding = Embedding.embed(mesh.vertices, mesh)
    x = np.random.default_rng(3).normal(size=mesh.vertices.shape)
    np.testing.assert_allclose(embedding(x), x, atol=1e-9)


def test_matrices_are_the_same_map(mesh):
    points = np.random.default_rng(4).uniform(0, 1, (50, 3))
    embedding = Embedding.embed(points, mesh)
    n = len(mesh.vertices)
    x = np.random.default_rng(5).normal(size=(n, 3))
    np.testing.assert_allclose(embedding.matrix(n) @ x, embedding(x), atol=1e-12)
    np.testing.assert_allclose(embedding.matrix3(n) @ x.ravel(), embedding(x).ravel(), atol=1e-12)


def test_nothing_to_embed(mesh):
    assert Embedding.embed(np.zeros((0, 3)), mesh)(mesh.vertices).shape == (0, 3)
