"""The upper envelope: exact at vertices, conforming, and right in volume, ties and thin regions included."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from tests.anatomy.meshes import (
    box,
    euler_characteristic,
    positive,
    require_closed_labels,
    require_conforming,
)

from handpipe.anatomy.templates.envelope import Envelope, contenders, upper_envelope
from handpipe.core.errors import InputError
from handpipe.mesh.tets.tetrahedra import TetMesh


def random_mesh(random: np.random.Generator) -> TetMesh:
    """The Delaunay tets of a few random points, or one or two tets, or a cut cube."""
    kind = random.integers(4)
    if kind == 0:
        mesh = box((1, 1, 1))
        keep = random.permutation(6)[: random.integers(1, 7)]
        return TetMesh(mesh.vertices, mesh.tets[keep])
    if kind == 1:
        return box((2, 1, 1))
    points = random.random((random.integers(5, 11), 3))
    return positive(points, Delaunay(points).simplices)


def random_values(random: np.random.Generator, n: int) -> np.ndarray:
    """Values without ties, of few levels (ties at vertices, edges and whole tets), or nearly equal ones."""
    k = random.integers(1, 8)
    kind = random.integers(4)
    if kind == 0:
        return random.standard_normal((n, k))
    if kind == 1:
        return random.integers(0, 3, (n, k)).astype(float)
    if kind == 2:
        return random.standard_normal((n, k)) * 10.0 ** random.integers(-12, 3, (n, k))
    return random.integers(0, 2, (n, k)) + 1e-9 * random.standard_normal((n, k))


def require_envelope(mesh: TetMesh, envelope: Envelope) -> None:
    at_corners = envelope.values[envelope.mesh.tets]
    of_label = np.take_along_axis(at_corners, envelope.labels[:, None, None], axis=2)[:, :, 0]
    assert np.array_equal(of_label, at_corners.max(axis=2))  # to the last bit
    assert (envelope.mesh.volumes() > 0).all()
    np.testing.assert_allclose(envelope.mesh.volumes().sum(), mesh.volumes().sum(), rtol=1e-12)
    source = np.bincount(envelope.source, envelope.mesh.volumes(), len(mesh.tets))
    np.testing.assert_allclose(source, mesh.volumes(), rtol=1e-9, atol=1e-15)
    require_conforming(envelope.mesh, mesh.boundary().area())
    require_closed_labels(envelope.mesh, envelope.labels)
    assert euler_characteristic(envelope.mesh) == euler_characteristic(mesh)


@pytest.mark.parametrize("snap", [0.0, 0.2])
def test_random_functions_on_small_meshes(snap: float) -> None:
    for seed in range(500):
        random = np.random.default_rng([seed, int(10 * snap)])
        mesh = random_mesh(random)
        values = random_values(random, len(mesh.vertices))
        require_envelope(mesh, upper_envelope(mesh, values, snap=snap))


def test_labels_are_the_largest_of_the_given_functions() -> None:
    """Against the given values alone: at random points in every tet the label is the largest there."""
    random = np.random.default_rng(0)
    for _ in range(50):
        mesh = random_mesh(random)
        values = random.standard_normal((len(mesh.vertices), 6))
        envelope = upper_envelope(mesh, values)
        weights = random.dirichlet(np.ones(4), len(envelope.labels))
        points = np.einsum("tc,tcd->td", weights, envelope.mesh.vertices[envelope.mesh.tets])
        corners = mesh.vertices[mesh.tets[envelope.source]]
        matrix = np.concatenate([np.swapaxes(corners, 1, 2), np.ones((len(points), 1, 4))], axis=1)
        right = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        inside = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
        given = np.einsum("tc,tck->tk", inside, values[mesh.tets[envelope.source]])
        chosen = np.take_along_axis(given, envelope.labels[:, None], axis=1)[:, 0]
        assert (chosen >= given.max(axis=1) - 1e-4).all()
        close = chosen >= given.max(axis=1) - 1e-12
        assert envelope.mesh.volumes()[~close].sum() < 1e-4 * mesh.volumes().sum()


def test_slab_thinner_than_a_tet() -> None:
    """Three functions of x leave the middle one a slab of a tenth of a cell: its volume is exact."""
    mesh = box((5, 5, 5))
    x = mesh.vertices[:, 0] - 0.47
    envelope = upper_envelope(mesh, np.stack([-x, x, np.full(len(x), 0.01)], axis=1))
    volumes = np.bincount(envelope.labels, envelope.mesh.volumes())
    np.testing.assert_allclose(volumes, [0.46, 0.52, 0.02], rtol=1e-9)
    require_envelope(mesh, envelope)


def test_more_functions_than_meet_in_a_point() -> None:
    """Twelve cones around the middle of a box, by planes through one line: equal wedges."""
    mesh = box((4, 4, 2))
    angle = 2 * np.pi * (np.arange(12) + 0.3) / 12
    values = (mesh.vertices[:, :2] - 0.5) @ np.stack([np.cos(angle), np.sin(angle)])
    envelope = upper_envelope(mesh, values)
    require_envelope(mesh, envelope)
    x = envelope.mesh.vertices[envelope.mesh.tets].mean(axis=1)[:, :2] - 0.5
    expected = np.argmax(x @ np.stack([np.cos(angle), np.sin(angle)]), axis=1)
    assert envelope.mesh.volumes()[expected != envelope.labels].sum() < 1e-9


def test_border_of_two_functions_is_a_sphere_to_second_order() -> None:
    errors = []
    for n in (4, 8, 16):
        mesh = box((n, n, n))
        inside = 0.35 - np.linalg.norm(mesh.vertices - 0.5, axis=1)
        envelope = upper_envelope(mesh, np.stack([np.zeros_like(inside), inside], axis=1))
        errors.append(abs(envelope.mesh.volumes()[envelope.labels == 1].sum() - 4 / 3 * np.pi * 0.35**3))
    assert errors[0] / errors[1] > 3 and errors[1] / errors[2] > 3


def test_of_equal_functions_the_first_stands() -> None:
    mesh = box((2, 2, 2))
    values = np.repeat(np.random.default_rng(0).random((len(mesh.vertices), 1)), 3, axis=1)
    envelope = upper_envelope(mesh, values)
    assert (envelope.labels == 0).all() and np.array_equal(envelope.mesh.tets, mesh.tets)


def test_snapping_moves_borders_by_less_than_its_share_and_removes_small_tets() -> None:
    mesh = box((8, 8, 8))
    x = mesh.vertices @ np.array([0.8, 0.5, 0.33])
    values = np.stack([0.7 - x, x - 0.7], axis=1)
    exact, snapped = upper_envelope(mesh, values), upper_envelope(mesh, values, snap=0.2)
    assert snapped.mesh.volumes().min() > 1e3 * exact.mesh.volumes().min()
    border = np.intersect1d(*(np.unique(snapped.mesh.tets[snapped.labels == label]) for label in (0, 1)))
    away = np.abs(snapped.mesh.vertices[border] @ np.array([0.8, 0.5, 0.33]) - 0.7)
    assert away.max() < 0.2 * np.sqrt(3) / 8


@pytest.mark.parametrize(
    ("values", "snap", "field"),
    [
        (np.zeros((3, 2)), 0.0, "values"),
        (np.full((8, 2), np.nan), 0.0, "values"),
        (np.zeros((8, 2)), 0.5, "snap"),
    ],
)
def test_wrong_input_is_named(values: np.ndarray, snap: float, field: str) -> None:
    with pytest.raises(InputError, match=field):
        upper_envelope(box((1, 1, 1)), values, snap=snap)


def test_contenders_have_the_same_envelope() -> None:
    """What is put to the floor is nowhere the largest, and a function's noise elsewhere cuts nothing."""
    mesh = box((6, 6, 6), (6.0, 6.0, 6.0))
    rng = np.random.default_rng(3)
    centres = rng.uniform(0, 6, (5, 3))
    values = np.stack([np.maximum(0, 3.0 - np.linalg.norm(mesh.vertices - c, axis=1)) for c in centres], 1)
    values += 1e-6 * rng.normal(size=values.shape)
    values = np.column_stack([np.full(len(values), 0.2), values])
    kept = contenders(mesh.tets, values)
    np.testing.assert_array_equal(kept[mesh.tets].max(axis=2), values[mesh.tets].max(axis=2))
    assert (kept < values).any()
    whole, less = upper_envelope(mesh, values, snap=0.0), upper_envelope(mesh, kept, snap=0.0)
    assert len(less.labels) <= len(whole.labels)
    volumes = [np.bincount(e.labels, e.mesh.volumes(), 6) for e in (whole, less)]
    np.testing.assert_allclose(volumes[1], volumes[0], atol=1e-9)
