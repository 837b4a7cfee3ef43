"""Strains over poses: gradient, known shapes, and what interpolation of their logarithms keeps."""

from dataclasses import replace

import numpy as np
import pytest
from tests.tissues.muscles.shapes import bent, box, surface_of

from handpipe.core.errors import ConvergenceError
from handpipe.fem.elements import plasticity
from handpipe.mesh.tets.operators import tet_laplacian
from handpipe.shapes.strains.stretch import StretchField
from handpipe.tissues.muscles.fitting.pose_strains import (
    KnownShape,
    StrainOptions,
    _Block,
    _result,
    fit_pose_strains,
    pose_laplacian,
)


def test_gradient_agrees_with_differences():
    mesh, random = box((2, 2, 1)), np.random.default_rng(1)
    w = surface_of(mesh)
    block = _Block(
        StretchField(mesh), tet_laplacian(mesh.tets), w, np.full(w.shape[0], 0.7), w @ mesh.vertices
    )
    x = mesh.vertices + 0.2 * random.standard_normal(mesh.vertices.shape)
    pulled = 0.1 * random.standard_normal((len(mesh.tets), 6))
    block.linearise(x)
    block.factorise(0.3)
    gradient = block.gradient(x, pulled)
    for vertex, axis in ((0, 0), (4, 1), (9, 2)):
        step = np.zeros_like(x)
        step[vertex, axis] = 1e-5
        change = block.value(x + step, pulled) - block.value(x - step, pulled)
        assert 2 * gradient[vertex, axis] == pytest.approx(change / 2e-5, rel=1e-5)


def test_normal_matrix_is_the_hessian_where_residuals_vanish():
    mesh = box((2, 1, 1))
    w = surface_of(mesh)
    block = _Block(
        StretchField(mesh), tet_laplacian(mesh.tets), w, np.full(w.shape[0], 0.7), w @ mesh.vertices
    )
    block.linearise(mesh.vertices)
    block.factorise(0.3)
    still = np.zeros((len(mesh.tets), 6))
    matrix = (block.smooth + 0.3 * block.near + block.data).toarray()
    for k in (0, 7, 20):
        step = np.zeros(mesh.vertices.size)
        step[k] = 1e-5
        step = step.reshape(-1, 3)
        change = block.gradient(mesh.vertices + step, still) - block.gradient(mesh.vertices - step, still)
        assert matrix[:, k] == pytest.approx(change.ravel() / 2e-5, rel=1e-5, abs=1e-6)


def test_pose_laplacian_kills_constants_and_prefers_the_near():
    space = pose_laplacian(np.array([[0.0], [0.1], [1.0]]))
    assert space @ np.ones(3) == pytest.approx(np.zeros(3))
    assert space[0, 1] < space[0, 2] < 0


def known(w, shapes, starts):
    """Shapes of the mesh as `fit_pose_strains` takes them."""
    return [KnownShape(w @ shape, start) for shape, start in zip(shapes, starts, strict=True)]


def fitted():
    mesh = box((8, 2, 2), (20.0, 4.0, 4.0))
    w = surface_of(mesh)
    angles = np.array([0.3, 0.7, 1.2])
    shapes = [bent(mesh.vertices, a, 0.2 * a) for a in angles]
    poses = angles[:, None] * np.array([[0.0, 1.0, 0.0]])
    random = np.random.default_rng(0)
    starts = [s + 0.05 * random.standard_normal(s.shape) for s in shapes]
    return mesh, w, shapes, fit_pose_strains(mesh, w, known(w, shapes, starts), poses)


def test_known_shapes_come_back_and_no_tet_inverts():
    mesh, w, shapes, result = fitted()
    assert result.gamma > 0
    for x, shape in zip(result.vertices, shapes, strict=True):
        assert np.linalg.norm(w @ (x - shape), axis=1).max() < 0.51
        assert np.linalg.norm(x - shape, axis=1).mean() < 0.3
        assert mesh.moved(x).volumes().min() > 0


def test_an_inverted_tet_fails_with_its_place():
    mesh = box((2, 1, 1))
    turned = mesh.vertices.copy()
    a, b, c, d = mesh.tets[0]
    turned[a] += 2.5 * (turned[[b, c, d]].mean(axis=0) - turned[a])
    with pytest.raises(ConvergenceError, match=r"example 2 of 2 .*inverted.* mm has det F"):
        _result(mesh, StretchField(mesh), np.stack([mesh.vertices, turned]), 1.0, np.zeros(2), [])


def test_strains_are_the_stretch_of_the_vertices():
    mesh, _, _, result = fitted()
    f = StretchField(mesh).deformation(result.vertices[2])
    elastic = f @ np.linalg.inv(plasticity.to_matrices(result.strains[2]))
    turned = np.swapaxes(elastic, 1, 2) @ elastic
    assert turned == pytest.approx(np.broadcast_to(np.eye(3), turned.shape), abs=1e-8)


def test_pose_smoothness_trades_distance_for_likeness():
    mesh, w, shapes, _ = fitted()
    poses = np.array([[0.3], [0.7], [1.2]]) * np.array([[0.0, 1.0, 0.0]])
    shapes[1] = bent(mesh.vertices, 0.7, -0.15)  # an outlier among its neighbours

    def fit(largest: float):
        options = StrainOptions(largest=largest)
        return fit_pose_strains(mesh, w, known(w, shapes, shapes), poses, options=options)

    close, smooth = fit(0.05), fit(0.5)
    space = pose_laplacian(np.vstack([np.zeros(3), poses]))

    def roughness(result) -> float:
        logs = np.stack([plasticity.log(s) for s in result.strains])
        nodes = np.concatenate([np.zeros_like(logs[:1]), logs])
        return float((np.tensordot(space, nodes, axes=1) ** 2).sum())

    assert roughness(smooth) < 0.7 * roughness(close)
    assert smooth.distances.max() > close.distances.max()


def test_what_touches_a_neighbour_is_not_smoothed_into_it():
    mesh, w, shapes, _ = fitted()
    poses = np.array([[0.3], [0.7], [1.2]]) * np.array([[0.0, 1.0, 0.0]])
    shapes[1] = bent(mesh.vertices, 0.7, -0.15)
    surfaces = [w @ s for s in shapes]
    touching = [np.flatnonzero(s[:, 1] > 1.9) for s in surfaces]

    def off(ids) -> float:
        given = [
            replace(shape, touching=own) for shape, own in zip(known(w, shapes, shapes), ids, strict=True)
        ]
        result = fit_pose_strains(mesh, w, given, poses)
        return max(
            float(np.linalg.norm((w @ x - y)[ids], axis=1).max())
            for x, y, ids in zip(result.vertices, surfaces, touching, strict=True)
        )

    assert off(touching) < 0.05 < off(np.empty((3, 0), int))


@pytest.mark.parametrize("mirrored", [True, False])
def test_no_tet_turns_inside_out_however_its_surface_is_pulled(mirrored):
    """A plate whose surface is asked to be its mirror image, or one corner to lie beyond its far end."""
    rest = box((6, 2, 1), (12.0, 4.0, 1.0))
    w = surface_of(rest)
    target = w @ rest.vertices
    if mirrored:
        target = target * [1, 1, -1] + [0, 0, 1]
    else:
        target[(target == target.max(axis=0)).all(axis=1)] -= [6, 2, 3]
    fit = fit_pose_strains(rest, w, [KnownShape(target, rest.vertices)], np.array([[0.5]]))
    assert rest.moved(fit.vertices[0]).volumes().min() > 0
