"""Steps over the strains of all tets against finite differences and dense linear algebra."""

import numpy as np
import pytest
import scipy.sparse as sp
from tests.tissues.muscles.shapes import box

from handpipe.core.errors import InputError
from handpipe.fem.elements import plasticity
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.rigid_motions import LooseMotions
from handpipe.shapes.optimisation.all_tets import AllTets
from handpipe.shapes.optimisation.gauss_newton import RIDGE, GaussNewton
from handpipe.shapes.optimisation.search import Search
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.optimisation.strain_space import Stage, State
from handpipe.shapes.strains.smoothness import Smoothness
from handpipe.shapes.strains.stretch import COUNTS

MESH = box((4, 2, 2), (12.0, 4.0, 4.0))


def search(attached: str) -> tuple[Search, AllTets, State, Correspondence]:
    """A bar attached at one end, along one edge or not at all, under small strains, and marks beside it."""
    x = MESH.vertices
    ids = {
        "end": np.flatnonzero(x[:, 0] == 0),
        "edge": np.flatnonzero((x[:, 0] == 0) & (x[:, 1] == 0)),
        "nothing": np.zeros(0, int),
    }[attached]
    settings = OrganSettings(beta=2.0)
    space = AllTets(MESH.tets, settings)
    found = Search(MESH, space, settings)
    attachments = AttachmentTargets.place(Attached.vertices(ids, x[ids], len(x)), (), x)
    rng = np.random.default_rng(1)
    middles = x[MESH.tets].mean(axis=1)
    logs = 0.01 * middles @ rng.standard_normal((3, 6))
    outer = MESH.boundary_vertices()[::3]
    matrix = sp.csr_matrix(
        (np.ones(len(outer)), outer, np.arange(len(outer) + 1)), shape=(len(outer), len(x))
    )
    marks = Correspondence(matrix, 1.1 * x[outer] + 0.3 * rng.standard_normal((len(outer), 3)), None)
    return found, space, found.at(logs, attachments, x), marks


def system(attached: str) -> tuple[Search, State, Correspondence, GaussNewton]:
    found, space, state, marks = search(attached)
    return found, state, marks, space.system(state, found.external(state.attachments), marks, 1.0)


def dense(system: GaussNewton) -> tuple[np.ndarray, np.ndarray]:
    """The same minimisation over all strains at once, by the normal equations of Wang 2021 Eq. 5.11."""
    m = len(system.logs)
    follow = np.stack([system.response.motion(d.reshape(m, 6)) for d in np.eye(6 * m)], axis=1)
    z = np.hstack([system.rows.matrix @ follow, system.rows.matrix @ system.response.loose])
    rough = np.kron(np.linalg.matrix_power(system.smoothness.laplacian.toarray(), 2), np.diag(COUNTS))
    rough += np.kron(np.ones((m, m)) / m**2, np.diag(RIDGE))
    r = system.response.loose.shape[1]
    hessian = np.zeros((6 * m + r, 6 * m + r))
    hessian[: 6 * m, : 6 * m] = rough
    hessian[6 * m :, 6 * m :] = np.diag(system.ridge[6:])
    gradient = z.T @ system.rows.residuals
    gradient[: 6 * m] += rough @ system.logs.ravel()
    found = -np.linalg.solve(hessian + z.T @ z, gradient)
    return found[: 6 * m].reshape(m, 6), found[6 * m :]


@pytest.mark.parametrize("attached", ["end", "edge", "nothing"])
def test_all_solvers_give_the_step_of_the_dense_system(attached: str) -> None:
    strains, loose = dense(system(attached)[3])
    model = system(attached)[3]
    for step in (model.by_rows(tolerance=1e-10), model.by_iteration(tolerance=1e-9, most=2000)):
        assert step.strains == pytest.approx(strains, abs=1e-4 * np.abs(strains).max())
        assert step.loose == pytest.approx(loose, abs=1e-4 * np.abs(strains).max())
        assert step.slope < 0


@pytest.mark.parametrize("attached", ["end", "edge", "nothing"])
def test_motion_and_slope_are_those_of_a_small_step(attached: str) -> None:
    found, state, marks, model = system(attached)
    step = model.by_rows()
    motions = LooseMotions(state.attachments.targets, state.x)
    assert motions.count == {"end": 0, "edge": 1, "nothing": 6}[attached]
    size = 1e-3
    moved = state.x + size * step.motion
    trial = found.at(state.unknowns + size * step.strains, state.attachments, moved)
    assert np.abs(trial.x - moved).max() < 0.02 * np.abs(trial.x - state.x).max()
    change = found.objective(trial, marks, 1.0) - found.objective(state, marks, 1.0)
    assert change / size == pytest.approx(step.slope, rel=0.02)


def test_a_truncated_iteration_lowers_the_model_already() -> None:
    model = system("end")[3]
    best = model.by_rows().slope
    few = model.by_iteration(tolerance=1e-12, most=5)
    assert few.iterations == 5
    assert best < few.slope < 0.5 * best or few.slope <= best


def test_pull_is_the_transpose_of_motion() -> None:
    response = system("nothing")[3].response
    rng = np.random.default_rng(0)
    change, forces = rng.standard_normal((len(MESH.tets), 6)), rng.standard_normal(3 * len(MESH.vertices))
    assert np.vdot(response.pull(forces), change) == pytest.approx(forces @ response.motion(change))


def test_uniform_growth_of_a_free_body_is_found_in_a_few_steps() -> None:
    settings = OrganSettings(enough=1e-4)
    found = Search(MESH, AllTets(MESH.tets, settings), settings)
    grown = MESH.vertices @ np.diag([1.4, 0.8, 1.2]) + [3.0, -2.0, 1.0]
    marks = Correspondence(sp.identity(len(grown), format="csr"), grown, None)
    free = AttachmentTargets.place(Attached.nothing(len(grown)), (), MESH.vertices)
    state = found.run(found.begin(free, MESH.vertices), Stage("marks", lambda x: marks, 1.0, 1, 10))
    assert state.x == pytest.approx(grown, abs=1e-3)
    expected = np.tile([1.4, 0, 0, 0.8, 0, 1.2], (len(MESH.tets), 1))
    assert plasticity.exp(state.unknowns) == pytest.approx(expected, abs=1e-3)


def test_smoothness_is_inverted_up_to_constants() -> None:
    smoothness = Smoothness(MESH.tets)
    logs = np.random.default_rng(0).standard_normal((len(MESH.tets), 6))
    assert smoothness.unroot(smoothness.root(logs)) == pytest.approx(logs - logs.mean(axis=0))
    assert smoothness.energy(np.ones_like(logs)) == pytest.approx(0, abs=1e-20)
    step = 1e-6 * np.random.default_rng(1).standard_normal(logs.shape)
    change = smoothness.energy(logs + step) - smoothness.energy(logs - step)
    assert change == pytest.approx(2 * np.vdot(smoothness.gradient(logs), step), rel=1e-5)


def test_a_body_in_two_parts_is_refused() -> None:
    apart = TetMesh(
        np.concatenate([MESH.vertices, MESH.vertices + 50]), np.concatenate([MESH.tets, MESH.tets + 45])
    )
    with pytest.raises(InputError, match="2 parts"):
        Smoothness(apart.tets)


@pytest.mark.parametrize("attached", ["end", "nothing"])
def test_coarse_strains_leave_few_products_with_the_rows(attached: str) -> None:
    model = system(attached)[3]
    rows = len(model.rows.residuals)
    assert rows > 40
    assert 0 < model.by_rows(tolerance=1e-6).iterations < rows / 2


def test_the_coarse_gram_is_a_part_of_the_whole() -> None:
    model = system("end")[3]
    reactions = model.reactions()
    lower = [model.gram(reactions), model.smoothness.coarse.gram(model.response.pulls, reactions)]
    whole, part = (np.tril(g) + np.tril(g, -1).T for g in lower)
    assert np.linalg.eigvalsh(whole - part).min() > -1e-10 * np.trace(whole)
    assert 0.5 * np.trace(whole) < np.trace(part) < np.trace(whole)
