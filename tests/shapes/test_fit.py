"""Shape from plastic strains: a known strain field comes back from marks on its surface."""

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation
from tests.tissues.muscles.shapes import box

from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.solver import equilibrium
from handpipe.mesh.surfaces.surface import Surface
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.correspondence import Correspondence, Markers
from handpipe.shapes.observations.rigid_motions import LooseMotions
from handpipe.shapes.optimisation.fit import EmbeddedSurface, KnownPoints, fit_shape
from handpipe.shapes.optimisation.search import Search
from handpipe.shapes.optimisation.settings import MUSCLE, ShapeOptions
from handpipe.shapes.optimisation.smooth_fields import SmoothFields
from handpipe.shapes.optimisation.strain_space import Stage
from handpipe.shapes.strains.smooth_strains import SmoothStrains


def grown():
    """A beam attached at one end, and its equilibrium under smooth plastic strains of 0.7 to 1.6."""
    mesh = box((8, 2, 2), (24.0, 6.0, 6.0))
    x = mesh.vertices[mesh.tets].mean(axis=1)[:, 0] / 24.0
    logs = np.zeros((len(mesh.tets), 6))
    logs[:, 0], logs[:, 3], logs[:, 2] = 0.3 * np.sin(np.pi * x), 0.4 * x - 0.3, 0.15 * x
    ids = np.flatnonzero(mesh.vertices[:, 0] < 1e-9)
    attached = Attached.vertices(ids, mesh.vertices[ids], len(mesh.vertices))
    elastic = Elastic(mesh.vertices, mesh.tets, MUSCLE, plasticity.exp(logs))
    springs = Attachment(attached.matrix, attached.targets, 500.0)
    return mesh, attached, equilibrium.solve([elastic, springs], mesh.vertices).x


def test_a_known_strain_field_comes_back_from_marks():
    mesh, attached, truth = grown()
    surface = Surface(mesh.vertices, mesh.boundary_faces()[0])
    embedding = sparse.identity(len(mesh.vertices), format="csr")
    outer = mesh.boundary_vertices()[::2]
    marks = Markers(truth[outer], np.ones(len(outer)), outer)
    options = ShapeOptions(alpha=10.0, beta=10.0, iterations=12, enough=1e-3, progress=1e-4, tangential=1.0)
    fit = fit_shape(
        EmbeddedSurface(mesh, surface, embedding), KnownPoints(attached), lambda s: marks, options=options
    )
    diagonal = np.linalg.norm(np.ptp(truth, axis=0))
    errors = np.linalg.norm(fit.vertices - truth, axis=1)
    assert np.linalg.norm(truth - mesh.vertices, axis=1).max() > 0.1 * diagonal
    assert errors[mesh.boundary_vertices()].max() < 0.005 * diagonal
    assert errors[mesh.boundary_vertices()].mean() < 0.002 * diagonal
    assert plasticity.eigenvalues(fit.strains).min() > 0.3


def test_the_fit_is_an_equilibrium_of_its_strains():
    mesh, attached, truth = grown()
    embedding = sparse.identity(len(mesh.vertices), format="csr")
    outer = mesh.boundary_vertices()
    surface = Surface(mesh.vertices, mesh.boundary_faces()[0])
    marks = Markers(truth[outer], np.ones(len(outer)))
    fit = fit_shape(EmbeddedSurface(mesh, surface, embedding), KnownPoints(attached), lambda s: marks)
    elastic = Elastic(mesh.vertices, mesh.tets, MUSCLE, fit.strains)
    springs = Attachment(attached.matrix, attached.targets, 500.0)
    forces = elastic.gradient(fit.vertices) + springs.gradient(fit.vertices)
    assert np.abs(forces).max() < 1e-3 * np.abs(springs.gradient(fit.vertices)).max() + 1e-6
    assert fit.record[-1].marker_max < 0.2
    assert [r.objective for r in fit.record][-1] < 0.2 * max(r.objective for r in fit.record)


def halves(attached: Attached) -> tuple[Attached, list[sparse.csr_matrix]]:
    """Half of the attached points, and the other half as a loose end."""
    some = np.arange(len(attached.targets) // 2)
    rest = np.arange(len(some), len(attached.targets))
    return attached.chosen(some), [attached.matrix[rest]]


@pytest.mark.parametrize("loose", [False, True])
def test_predicted_motion_agrees_with_a_small_step(loose):
    mesh, attached, truth = grown()
    half, ends = halves(attached) if loose else (attached, [])
    options = ShapeOptions(fields=(1, 4), spring=100.0)
    space = SmoothFields(mesh, truth, options)
    search = Search(mesh, space, options)
    marks = Correspondence(sparse.identity(len(truth), format="csr"), truth, None)
    state = search.at(space.guess, AttachmentTargets.place(attached, ends, mesh.vertices), truth)
    found = space.step(
        state, search.external(state.attachments), marks, Stage("marks", lambda x: marks, 0.1, 4, 1)
    )
    assert len(found.ends) == 6 * len(ends)
    size = 1e-3
    trial = search.taken(state, found, size, LooseMotions(state.attachments.targets, state.x))
    motion = (trial.x - state.x) / size
    assert motion == pytest.approx(found.motion, rel=0.02, abs=0.02 * np.abs(found.motion).max())
    change = search.objective(trial, marks, 0.1) - search.objective(state, marks, 0.1)
    assert change / size == pytest.approx(found.slope, rel=0.02)


def test_a_body_whose_ends_are_all_loose_is_found_where_its_marks_are():
    """Both ends are taken to be at rest; marks show the body turned by 10 degrees and 2 mm away."""
    mesh, attached, _ = grown()
    turn = Rotation.from_euler("z", 10, degrees=True)
    truth = turn.apply(mesh.vertices) + [0.0, 2.0, 1.0]
    half, ends = halves(attached)
    outer = mesh.boundary_vertices()
    surface = Surface(mesh.vertices, mesh.boundary_faces()[0])
    marks = Markers(truth[outer], np.ones(len(outer)), outer)
    embedding = sparse.identity(len(mesh.vertices), format="csr")
    nothing = half.chosen(np.arange(0))
    fit = fit_shape(
        EmbeddedSurface(mesh, surface, embedding),
        KnownPoints(nothing, [half.matrix, *ends]),
        lambda s: marks,
    )
    assert np.linalg.norm(truth - mesh.vertices, axis=1).mean() > 2.0
    assert np.linalg.norm(fit.vertices - truth, axis=1).mean() < 0.1
    assert plasticity.eigenvalues(fit.strains) == pytest.approx(1.0, abs=0.1)


def test_smooth_fields_are_eigenvectors_and_all_of_them_span_everything():
    mesh = box((2, 1, 1))
    basis = SmoothStrains.compute(mesh.tets, 100)
    assert basis.fields.shape == (len(mesh.tets), len(mesh.tets))
    logs = np.random.default_rng(0).standard_normal((len(mesh.tets), 6))
    assert basis(basis.project(logs)) == pytest.approx(logs)
    assert basis.values[0] == 0 and (np.diff(basis.values) > -1e-9).all()
    assert basis.roughness(basis.project(np.ones((len(mesh.tets), 6)))) == pytest.approx(0, abs=1e-12)
