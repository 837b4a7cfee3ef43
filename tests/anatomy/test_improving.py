"""Borders of labels smooth, tets good, and nothing else changed."""

import numpy as np
import pytest
from tests.anatomy.meshes import box, require_closed_labels, require_conforming

from handpipe.anatomy.improvement.cleaning import cleaned, label_parts
from handpipe.anatomy.improvement.improving import Labelled, improve
from handpipe.anatomy.templates.envelope import upper_envelope
from handpipe.core.errors import InputError
from handpipe.mesh.tets.operators import tet_neighbours
from handpipe.mesh.tets.tetrahedra import TetMesh

N = 12


def ball_values(mesh: TetMesh) -> np.ndarray:
    """A background, a ball, and half a ball that cuts into it."""
    inside = 0.3 - np.linalg.norm(mesh.vertices - [0.45, 0.5, 0.5], axis=1)
    other = 0.32 - np.linalg.norm(mesh.vertices - [0.75, 0.55, 0.5], axis=1)
    return np.stack([np.zeros(len(inside)), inside, other], axis=1)


@pytest.fixture(scope="module")
def balls() -> tuple[TetMesh, Labelled, Labelled]:
    mesh = box((N, N, N))
    envelope = upper_envelope(mesh, ball_values(mesh), snap=0.1)
    before = Labelled(envelope.mesh, cleaned(envelope.mesh, envelope.labels))
    return mesh, before, improve(before, mesh.boundary_vertices())


def test_smallest_dihedral_angle(balls: tuple[TetMesh, Labelled, Labelled]) -> None:
    _, before, after = balls
    assert before.mesh.smallest_dihedral() < 3
    assert after.mesh.smallest_dihedral() >= 10


def test_nothing_is_torn_or_lost(balls: tuple[TetMesh, Labelled, Labelled]) -> None:
    mesh, before, after = balls
    fixed = mesh.boundary_vertices()
    assert np.array_equal(after.mesh.vertices[: len(fixed)], mesh.vertices[fixed])
    np.testing.assert_allclose(after.mesh.volumes().sum(), 1, rtol=1e-9)
    require_conforming(after.mesh, 6.0)
    require_closed_labels(after.mesh, after.labels)
    for label in (0, 1, 2):
        surface = TetMesh(after.mesh.vertices, after.mesh.tets[after.labels == label]).boundary().compact()
        assert surface.is_closed()
    size = [np.bincount(x.labels, x.mesh.volumes()) for x in (before, after)]
    np.testing.assert_allclose(size[1], size[0], rtol=0.02)


def test_borders_become_smooth() -> None:
    """The first ball's free side against the sphere: far snapped zeros make steps, which smoothing takes
    away.
    """
    mesh, middle = box((N, N, N)), np.array([0.45, 0.5, 0.5])
    envelope = upper_envelope(mesh, ball_values(mesh), snap=0.3)
    labelled = Labelled(envelope.mesh, cleaned(envelope.mesh, envelope.labels))
    angles, away = [], []
    for sweeps in (0, 5):
        found = improve(labelled, mesh.boundary_vertices(), sweeps=sweeps)
        tets = found.mesh.tets[found.labels == 1]
        surface = TetMesh(found.mesh.vertices, tets).boundary().compact()
        outwards = surface.vertices[surface.triangles].mean(axis=1) - middle
        free = outwards[:, 0] < 0.05
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        cosine = (surface.triangle_normals() * outwards).sum(axis=1)[free]
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())
        on_sphere = surface.vertices[:, 0] < 0.5
        away.append(np.std(np.linalg.norm(surface.vertices[on_sphere] - middle, axis=1)))
    assert angles[1] < 0.65 * angles[0] and away[1] < 0.65 * away[0]


def test_random_fields_become_fit_for_simulation() -> None:
    """Noise of five functions on few tets, where borders and lines are everywhere."""
    for seed in range(4):
        random = np.random.default_rng(seed)
        mesh = box((6, 6, 6))
        waves = [np.cos(mesh.vertices @ random.uniform(-6, 6, 3) + random.uniform(0, 6)) for _ in range(5)]
        envelope = upper_envelope(mesh, np.stack(waves, axis=1), snap=0.2)
        before = Labelled(envelope.mesh, cleaned(envelope.mesh, envelope.labels))
        after = improve(before, mesh.boundary_vertices())
        assert after.mesh.smallest_dihedral() >= 5
        require_conforming(after.mesh, 6.0)
        require_closed_labels(after.mesh, after.labels)


def test_cleaning_removes_crumbs_and_pinches() -> None:
    mesh = box((4, 4, 4))
    cell = np.floor(4 * mesh.vertices[mesh.tets].mean(axis=1)).astype(int)
    labels = np.zeros(len(cell), dtype=np.int64)
    labels[(cell[:, 0] < 2) & (cell[:, 1] < 2)] = 1
    labels[(cell[:, 0] >= 2) & (cell[:, 1] >= 2)] = 1  # two blocks that touch in a line
    labels[np.flatnonzero((cell == [3, 0, 0]).all(axis=1))[0]] = 1  # and a crumb
    found = cleaned(mesh, labels)
    for label in (0, 1):
        assert TetMesh(mesh.vertices, mesh.tets[found == label]).boundary().compact().is_closed()
    assert (found != labels).sum() < 60
    assert len(np.unique(label_parts(found, tet_neighbours(mesh.tets)))) <= 4


def test_clean_labels_stay() -> None:
    mesh = box((4, 4, 4))
    labels = (mesh.vertices[mesh.tets].mean(axis=1)[:, 0] > 0.5).astype(np.int64)
    assert np.array_equal(cleaned(mesh, labels), labels)


def test_too_many_labels_are_refused() -> None:
    mesh = box((2, 2, 2))
    with pytest.raises(InputError, match="labels"):
        improve(Labelled(mesh, np.full(len(mesh.tets), 62)), mesh.boundary_vertices())
