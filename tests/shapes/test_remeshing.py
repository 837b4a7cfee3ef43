"""Tets that strains ruin are replaced, and what was known before goes on."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from tests.tissues.muscles.shapes import box

from handpipe.core.errors import HandpipeError
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.pull import Pull
from handpipe.mesh.generation.meshing import tetrahedralise
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.distance import Distance, sample_points
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.shapes.observations.carried import Carried
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.marks import BoundaryMarks, Pairs
from handpipe.shapes.optimisation.settings import MUSCLE, OrganSettings
from handpipe.shapes.optimisation.strain_space import Stage, State
from handpipe.shapes.organs import remeshing
from handpipe.shapes.organs.organ import Observed, OrganFit, fit_organ
from handpipe.shapes.organs.remeshing import Given, OnMesh, remeshed
from handpipe.shapes.strains.strain_frame import StrainFrame

SPHERE = trimesh.creation.icosphere(subdivisions=4)
SEMIAXES = np.array([30.0, 5.0, 4.0])


def banana() -> Surface:
    """A bent ellipsoid, as long as six times its width."""
    x, y, z = (SPHERE.vertices * SEMIAXES).T
    return Surface(np.column_stack([x, y + 0.01 * x**2, z]), SPHERE.faces)


@cache
def ball() -> TetMesh:
    """A ball of the same volume."""
    radius = float(np.prod(SEMIAXES) ** (1 / 3))
    return tetrahedralise(remesh(Surface(radius * SPHERE.vertices, SPHERE.faces), 2.6), 2.6)


@cache
def reached(below: float) -> OrganFit:
    """The ball on its way to the banana."""
    marks = trimesh.sample.sample_surface_even(
        trimesh.Trimesh(banana().vertices, banana().triangles), 220, seed=0
    )[0]
    return fit_organ(
        ball(), Observed(np.asarray(marks)), settings=OrganSettings(covering=True, remesh_below=below)
    )


def test_a_ball_reaches_a_banana_with_good_tets() -> None:
    fit, wanted = reached(5.0), banana()
    found = fit.mesh.boundary().compact()
    assert fit.quality["new_meshes"][0] >= 1
    assert fit.mesh.smallest_dihedral() > 6.0
    assert plasticity.eigenvalues(fit.strains).max() < 5.0
    assert Distance(wanted).closest(sample_points(found, 2000))[0].mean() < 0.3
    assert Distance(found).closest(sample_points(wanted, 2000))[0].mean() < 0.2
    assert fit.mesh.volumes().sum() == pytest.approx(wanted.volume(), rel=0.03)


def test_without_new_tets_the_same_fit_ruins_its_own() -> None:
    fit = reached(0.0)
    assert fit.quality["new_meshes"][0] == 0
    assert fit.mesh.smallest_dihedral() < 2.5
    assert plasticity.eigenvalues(fit.strains).max() > 8.0


def test_the_result_is_the_equilibrium_of_its_strains_from_its_rest_shape() -> None:
    fit = reached(5.0)
    body = Elastic(fit.rest.vertices, fit.rest.tets, MUSCLE, fit.strains)
    forces = np.abs(body.gradient(fit.mesh.vertices)).max()
    typical = np.abs(body.gradient(fit.rest.vertices)).max()
    assert forces < 1e-4 * typical


def test_points_of_the_template_are_carried_to_the_result() -> None:
    fit = reached(5.0)
    outer = ball().boundary_vertices()
    found = fit.mesh.boundary()
    assert np.median(Distance(found).closest(fit.carried[outer])[0]) < 0.3
    middle = ball().vertices[outer, 0]
    assert np.corrcoef(middle, fit.carried[outer, 0])[0, 1] > 0.95


@cache
def hanging() -> tuple[OnMesh, State]:
    """A bar of grown, flat cells, attached at one end and pulled at the other."""
    mesh = box((4, 4, 3), (10.0, 6.0, 6.0))
    end = np.flatnonzero(mesh.vertices[:, 0] == 0)
    tip = np.flatnonzero(mesh.vertices[:, 0] > 9.9)
    attached = Pairs(mesh.vertices[end], mesh.vertices[end]).attached(mesh)
    pull = Pull(sp.identity(len(mesh.vertices), format="csr")[tip], np.tile([0.0, 0.0, -0.5], (len(tip), 1)))
    given = Given(mesh, np.zeros((0, 3)), attached, None, (pull,), None, OrganSettings())
    task = OnMesh.of_template(given)
    place = mesh.vertices[mesh.tets].mean(axis=1) / 10.0
    logs = np.zeros((len(mesh.tets), 6))
    logs[:, 0], logs[:, 3], logs[:, 5] = 1.3, -0.3 * place[:, 0], -0.6 + 0.3 * place[:, 1]
    return task, task.search.at(logs, task.attachments, mesh.vertices * [3.6, 1.0, 0.6])


@cache
def meshed_anew() -> tuple[OnMesh, State]:
    return remeshed(*hanging())


def test_new_tets_keep_the_shape_under_load() -> None:
    task, state = hanging()
    alone = OnMesh.of_template(replace(task.given, loads=()))
    unloaded = alone.search.at(state.unknowns, alone.attachments, state.x)
    bent = np.abs(state.x - unloaded.x).max()
    assert bent > 2.0
    new, after = meshed_anew()
    assert len(new.mesh.tets) != len(task.mesh.tets)
    assert new.mesh.smallest_dihedral() > 1.5 * task.mesh.moved(state.x).smallest_dihedral()
    assert np.abs(after.x - new.mesh.vertices).max() < 0.1 * bent
    attached = np.abs(new.attachments.errors(after.x)).max()
    assert attached < 2 * np.abs(task.attachments.errors(state.x)).max() + 0.01


def test_smoothed_strains_go_on_where_tets_are_replaced() -> None:
    task, state = hanging()
    new, after = meshed_anew()
    weights = new.mesh.volumes() / new.mesh.volumes().sum()
    before = task.mesh.moved(state.x).volumes()
    assert weights @ after.unknowns == pytest.approx(before / before.sum() @ state.unknowns, abs=0.1)
    old_centres = state.x[task.mesh.tets].mean(axis=1)
    nearest = cKDTree(old_centres).query(new.mesh.vertices[new.mesh.tets].mean(axis=1))[1]
    assert (
        np.abs(after.unknowns - state.unknowns[nearest]).mean() < 0.1
    )  # of 1.3; steps that keep the shape add to it


def test_a_strain_frame_turns_strains_and_its_operator_is_its_derivative() -> None:
    rng = np.random.default_rng(0)
    turns = Rotation.random(3, random_state=1).as_matrix()
    total, since = rng.standard_normal((2, 3, 6))
    frame = StrainFrame.align(turns, total, since)
    assert frame(total) == pytest.approx(since)
    change = rng.standard_normal((3, 6))
    expected = turns @ plasticity.to_matrices(change) @ turns.swapaxes(1, 2)
    assert frame(total + change) - since == pytest.approx(plasticity.from_matrices(expected))
    assert np.einsum("mab,mb->ma", frame.operator(), change) == pytest.approx(
        plasticity.from_matrices(expected)
    )


def test_steps_over_replaced_tets_follow_the_objective() -> None:
    new, after = meshed_anew()
    rng = np.random.default_rng(0)
    targets = after.x + 0.3 * rng.standard_normal(after.x.shape)
    marks = Correspondence(sp.identity(len(after.x), format="csr"), targets, None)
    search, stage = new.search, Stage("marks", lambda x: marks, 1.0, None, 1)
    step = search.space.step(after, search.external(after.attachments), marks, stage)
    size = 1e-4
    trial = search.at(after.unknowns + size * step.strains, after.attachments, after.x + size * step.motion)
    change = search.objective(trial, marks, 1.0) - search.objective(after, marks, 1.0)
    assert change / size == pytest.approx(step.slope, rel=0.02)


def test_a_carried_potential_has_the_derivatives_of_its_energy() -> None:
    task, state = hanging()
    rng = np.random.default_rng(2)
    weights = rng.random((len(state.x), 7))
    carried = Carried(state.body, sp.csr_matrix(weights / weights.sum(axis=1, keepdims=True)))
    x, d = 10 * rng.standard_normal((2, 7, 3))
    h = 1e-5
    slope = (carried.value(x + h * d) - carried.value(x - h * d)) / (2 * h)
    assert slope == pytest.approx(np.vdot(carried.gradient(x), d), rel=1e-5)
    difference = (carried.gradient(x + h * d) - carried.gradient(x - h * d)) / (2 * h)
    assert carried.hessian(x) @ d.ravel() == pytest.approx(
        difference.ravel(), rel=1e-4, abs=1e-4 * np.abs(difference).max()
    )


def test_an_organ_that_cannot_be_meshed_keeps_its_tets(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> TetMesh:
        raise HandpipeError("no tets today")

    monkeypatch.setattr(remeshing, "tetrahedralise", refuse)
    marks = sample_points(banana(), 60)
    fit = fit_organ(
        ball(), Observed(marks), settings=OrganSettings(covering=True, remesh_below=20.0, iterations=3)
    )
    assert fit.quality["new_meshes"][0] == 0
    assert "no tets today" in caplog.text
    assert fit.quality["marks_mean"][0] < 0.5


def test_covering_marks_draw_in_what_is_far_from_all_of_them() -> None:
    mesh = box((10, 2, 2), (20.0, 4.0, 4.0))
    surface = mesh.boundary().compact()
    points = surface.vertices[surface.vertices[:, 0] <= 12.0]
    marks = BoundaryMarks(mesh, points, 0.1, covering=True)
    found = marks(mesh.vertices)
    drawn = np.asarray(found.matrix[len(points) :] @ mesh.vertices)
    assert set(np.unique(drawn[:, 0])) == {16.0, 18.0, 20.0}
    assert (found.targets[len(points) :, 0] < drawn[:, 0]).all()
    assert BoundaryMarks(mesh, points, 0.1)(mesh.vertices).count == len(points)
