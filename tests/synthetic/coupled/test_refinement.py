"""Refined meshes and quadratic elements against what polynomials integrate to."""

import numpy as np
from tests.fem.bodies import box

from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.continuum.balls import ball_means
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.continuum.refinement import Midpoints, refine

MESH = TetMesh(*box((3.0, 2.0, 1.0), (3, 2, 2)))


def test_refinement_fills_the_same_body_eight_to_one():
    fine, parents = refine(MESH)
    assert np.allclose(fine.volumes(), np.repeat(MESH.volumes() / 8, 8), rtol=1e-12)
    assert np.array_equal(np.bincount(parents), np.full(len(MESH.tets), 8))
    # Conforming: the boundary of the fine mesh is the coarse one's, cut into four.
    assert len(fine.boundary_faces()[0]) == 4 * len(MESH.boundary_faces()[0])
    assert fine.boundary().is_closed()
    centres = fine.vertices[fine.tets].mean(axis=1)
    corners = MESH.vertices[MESH.tets[parents]]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    inside = np.linalg.solve(edges, (centres - corners[:, 0])[:, :, None])[:, :, 0]
    assert inside.min() > 0 and inside.sum(axis=1).max() < 1


def test_repeated_refinement_keeps_angles():
    finer = refine(refine(MESH)[0])[0]
    assert finer.smallest_dihedral() > 0.5 * MESH.smallest_dihedral()


def test_nodes_of_quadratic_elements_are_the_refined_vertices():
    assert np.array_equal(Elements.quadratic(MESH).nodes, refine(MESH)[0].vertices)


def test_nodes_on_faces_are_all_there():
    left = np.flatnonzero(MESH.vertices[:, 0] == 0)
    middle = Midpoints.build(MESH)
    faces = MESH.boundary_faces()[0]
    chosen = middle.on_faces(faces[np.isin(faces, left).all(axis=1)])
    assert np.array_equal(chosen, np.flatnonzero(middle.nodes[:, 0] == 0))


def test_gradients_are_exact_for_quadratic_fields():
    elements = Elements.quadratic(MESH)
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(3, 3)), rng.normal(size=3)
    a = a + a.T
    field = np.einsum("ni,ij,nj->n", elements.nodes, a, elements.nodes) + elements.nodes @ b
    found = np.einsum("mqkd,mk->mqd", elements.gradients, field[elements.cells])
    corners = MESH.vertices[MESH.tets]
    from handpipe.synthetic.continuum.elements import FOUR_POINTS

    points = np.einsum("qc,mcd->mqd", FOUR_POINTS, corners)
    assert np.allclose(found, 2 * points @ a + b, atol=1e-12)
    # The rule integrates |x|^2 over the box exactly.
    integral = (elements.volumes * (points**2).sum(axis=2)).sum()
    assert np.isclose(integral, 6 * (9 + 4 + 1) / 3, rtol=1e-13)


def test_interpolation_is_exact_for_polynomials_of_the_order():
    points = np.random.default_rng(1).uniform([0, 0, 0], [3, 2, 1], (200, 3))
    for elements, power in ((Elements.linear(MESH), 1), (Elements.quadratic(MESH), 2)):
        carried = elements.interpolation(points) @ (elements.nodes @ [1.0, 2.0, -1.0]) ** power
        assert np.allclose(carried, (points @ [1.0, 2.0, -1.0]) ** power, atol=1e-12)


def test_means_over_balls_are_those_of_the_ball():
    for elements in (Elements.linear(MESH), Elements.quadratic(MESH)):
        means = ball_means(elements, np.array([[1.5, 1.0, 0.5], [0.1, 1.0, 0.5]]), 0.4)
        assert np.allclose(means.sum(axis=1), 1.0)
        assert np.allclose((means @ elements.nodes)[0], [1.5, 1.0, 0.5])
        assert (means @ elements.nodes)[1, 0] > 0.1  # half of the ball is outside
    # Of |x - centre|^2: 12/13 of the radius squared, which quadratic elements have exactly.
    squares = ((elements.nodes - [1.5, 1.0, 0.5]) ** 2).sum(axis=1)
    assert np.isclose((means @ squares)[0], 12 / 13 * 0.16)
