"""Which bone each end of a muscle is marked to."""

from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.shapes.bodies import bar
from tests.fem.bodies import sphere

from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.template_hands.muscle_ends import FEW, REACH, marked_ends

LENGTH = 20.0


def bones() -> dict[str, Surface]:
    """One beyond each end of the bar; a third beside its second end, farther from most of it."""
    points, triangles = sphere(4.0, 2)
    middles = {"near": (-8, 2, 2), "far": (LENGTH + 5, 2, 2), "other": (LENGTH - 1, 9.5, 4)}
    return {name: Surface(points + middle, triangles) for name, middle in middles.items()}


@pytest.fixture(scope="module")
def mesh():
    return bar((20, 4, 4), (LENGTH, 4.0, 4.0))


def ends(mesh, origin, insertion):
    template = SimpleNamespace(
        part=lambda name: (mesh, np.arange(len(mesh.vertices)) + 100),
        origins={"muscle": np.flatnonzero(origin) + 100},
        insertions={"muscle": np.flatnonzero(insertion) + 100},
    )
    subject = SimpleNamespace(bones=bones(), muscles={"muscle": None}, ligaments={})
    return marked_ends(template, subject)["muscle"]


def test_each_end_goes_whole_to_its_bone(mesh):
    x = mesh.vertices[:, 0]
    found = ends(mesh, x < 0.5, x > LENGTH - 0.5)
    outside = mesh.boundary_vertices()
    assert set(found) == {"near", "far"}
    np.testing.assert_array_equal(found["near"], np.flatnonzero(x[outside] < 0.5))
    np.testing.assert_array_equal(found["far"], np.flatnonzero(x[outside] > LENGTH - 0.5))


def test_an_end_of_one_vertex_takes_its_neighbours(mesh):
    x = mesh.vertices[:, 0]
    corner = np.zeros(len(x), bool)
    corner[np.argmin(np.linalg.norm(mesh.vertices, axis=1))] = True
    points = mesh.vertices[mesh.boundary_vertices()]
    found = points[ends(mesh, corner, x > LENGTH - 0.5)["near"]]
    assert len(found) >= FEW
    assert np.linalg.norm(found, axis=1).max() < REACH


def test_a_muscle_of_two_heads_is_held_by_two_bones(mesh):
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    heads = (x > LENGTH - 0.5) | ((x > LENGTH - 4) & (y > 3.5))
    found = ends(mesh, x < 0.5, heads)
    assert set(found) == {"near", "far", "other"}
