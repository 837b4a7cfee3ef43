"""Organs fitted to marks: known strains and shapes come back; bad input is named."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from tests.tissues.muscles.shapes import box

from handpipe.core.errors import InputError
from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver import equilibrium
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import MUSCLE, OrganSettings
from handpipe.shapes.organs.organ import Observed, fit_organ


def lump(cells: int = 4) -> TetMesh:
    """A bent, rounded box with a flat side: no rotation maps it onto itself."""
    mesh = box((2 * cells, cells, cells), (2.0, 2.0, 2.0))
    u = mesh.vertices - 1.0
    length = np.abs(u).max(axis=1, keepdims=True)
    ball = u * length / np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
    x, y, z = ((0.6 * ball + 0.4 * u) * [18.0, 8.0, 6.0]).T
    shape = np.column_stack([x, y + 0.012 * x**2 + 0.02 * x * z, np.where(z < 0, 0.5 * z, z)])
    return TetMesh(shape, mesh.tets).checked("lump")


def spread(mesh: TetMesh, count: int) -> np.ndarray:
    """Points on the surface, about evenly."""
    surface = mesh.boundary().compact()
    return np.asarray(
        trimesh.sample.sample_surface_even(
            trimesh.Trimesh(surface.vertices, surface.triangles), count, seed=0
        )[0]
    )


def far(mesh: TetMesh, other: TetMesh) -> np.ndarray:
    """Distances of one mesh's boundary vertices from the other's surface."""
    return Distance(other.boundary()).closest(mesh.vertices[mesh.boundary_vertices()])[0]


def test_strains_under_a_known_load_come_back_from_marks() -> None:
    mesh = box((10, 3, 3), (30.0, 9.0, 9.0))
    place = mesh.vertices[mesh.tets].mean(axis=1) / [30.0, 9.0, 9.0]
    logs = np.zeros((len(mesh.tets), 6))
    logs[:, 0], logs[:, 3], logs[:, 2] = 0.3 * place[:, 0], -0.2 * place[:, 0], 0.1 * place[:, 1]
    ids = np.flatnonzero(mesh.vertices[:, 0] < 1e-9)
    tip = np.flatnonzero(mesh.vertices[:, 0] > 29.9)
    outer = mesh.boundary_vertices()
    matrix = Pairs(mesh.vertices[tip], mesh.vertices[tip]).attached(mesh).matrix
    load = Pull(matrix, np.tile([0.0, 0.8, 0.0], (len(tip), 1)))
    hold = Pairs(mesh.vertices[ids], mesh.vertices[ids])
    springs = Attachment(hold.attached(mesh).matrix, hold.targets, 500.0)
    body = Elastic(mesh.vertices, mesh.tets, MUSCLE, plasticity.exp(logs))
    truth = equilibrium.solve([body, springs, load], mesh.vertices).x
    assert np.abs(truth - mesh.vertices).max() > 3.0
    fit = fit_organ(
        mesh,
        Observed(landmarks=Pairs(mesh.vertices[outer], truth[outer]), attachments=hold),
        loads=[load],
        settings=OrganSettings(alpha=100.0, beta=100.0),
    )
    diagonal = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    assert np.linalg.norm((fit.mesh.vertices - truth)[outer], axis=1).mean() < 0.002 * diagonal
    difference = plasticity.to_matrices(fit.strains - plasticity.exp(logs))
    size = np.linalg.norm(plasticity.to_matrices(plasticity.exp(logs)), axis=(1, 2))
    assert (np.linalg.norm(difference, axis=(1, 2)) / size).mean() < 0.05
    without = np.linalg.norm(plasticity.to_matrices(plasticity.exp(logs)) - np.eye(3), axis=(1, 2))
    assert np.linalg.norm(difference, axis=(1, 2)).mean() < 0.35 * without.mean()


@pytest.mark.parametrize("turned", [0.0, 90.0])
def test_a_free_organ_finds_its_shape_from_marks_alone(turned: float) -> None:
    mesh = lump()
    grown = mesh.vertices * [1.25, 1.0, 0.85]
    grown[:, 2] += 0.006 * grown[:, 0] ** 2
    wanted = mesh.moved(grown @ Rotation.from_euler("z", turned, degrees=True).as_matrix().T + [20, 5, -9])
    fit = fit_organ(mesh, Observed(spread(wanted, 90)))
    errors = far(fit.mesh, wanted)
    assert errors.mean() < 0.35
    assert errors.max() < 1.5
    assert fit.quality["marks_mean"][0] < 0.1
    assert fit.quality["inverted_tets"][0] == 0
    assert fit.quality["volume_after"][0] == pytest.approx(wanted.volumes().sum(), rel=0.03)


def test_outliers_are_left_out() -> None:
    mesh = lump()
    wanted = mesh.moved(mesh.vertices * [1.15, 0.95, 1.1])
    points = spread(wanted, 80)
    rng = np.random.default_rng(0)
    wrong = rng.choice(len(points), len(points) // 5, replace=False)
    points[wrong] += 8.0 * points[wrong] / np.linalg.norm(points[wrong], axis=1, keepdims=True)
    fit = fit_organ(mesh, Observed(points), settings=OrganSettings(outliers=True))
    assert not fit.kept[wrong].any()
    assert fit.kept.sum() > 0.9 * (len(points) - len(wrong))
    assert far(fit.mesh, wanted).mean() < 0.25
    trusting = fit_organ(mesh, Observed(points))
    assert far(trusting.mesh, wanted).mean() > 2 * far(fit.mesh, wanted).mean()


def test_three_attachments_on_a_line_leave_a_turn_that_marks_settle() -> None:
    mesh = lump()
    line = np.array([[-12.0, 1.0, 0.0], [0.0, 1.0, 0.0], [12.0, 1.0, 0.0]])
    turn = Rotation.from_euler("x", 25, degrees=True).as_matrix()
    wanted = mesh.moved((mesh.vertices - line[1]) @ turn.T + line[1])
    fit = fit_organ(mesh, Observed(spread(wanted, 60), attachments=Pairs(line, line)))
    assert far(fit.mesh, wanted).mean() < 0.2
    assert fit.quality["attachments_max"][0] < 0.3


def test_bad_input_is_named() -> None:
    mesh = lump(3)
    with pytest.raises(InputError, match="there are none"):
        fit_organ(mesh, Observed())
    with pytest.raises(InputError, match=r"shape \(2,\)"):
        fit_organ(mesh, Observed(np.zeros(2)))
    with pytest.raises(InputError, match="point 1"):
        fit_organ(mesh, Observed(np.array([[0.0, 0, 0], [np.nan, 0, 0]])))
    with pytest.raises(InputError, match="attachments"):
        fit_organ(mesh, Observed(np.zeros((3, 3)), attachments=Pairs(np.zeros((3, 3)), np.zeros((2, 3)))))


@pytest.mark.parametrize(("degrees", "arrives"), [(5.0, True), (60.0, False)])
def test_a_search_that_does_not_arrive_at_its_landmarks_says_so(
    degrees: float, arrives: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """A bar that is held at one end, and whose other end is turned about it."""
    mesh = box((6, 1, 1), (30.0, 6.0, 6.0))
    held, tip = (np.flatnonzero(np.abs(mesh.vertices[:, 0] - x) < 1e-9) for x in (0.0, 30.0))
    turned = Rotation.from_euler("z", degrees, degrees=True).apply(mesh.vertices[tip])
    seen = Observed(
        landmarks=Pairs(mesh.vertices[tip], turned),
        attachments=Pairs(mesh.vertices[held], mesh.vertices[held]),
    )
    fit = fit_organ(mesh, seen, settings=OrganSettings(iterations=0))
    apart = np.linalg.norm(fit.carried[tip] - turned, axis=1).max()
    assert (apart < 0.1) == arrives and (apart > 1.0) == (not arrives)
    assert ("landmarks are still" in caplog.text) == (not arrives)
