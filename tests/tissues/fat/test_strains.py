"""Plastic strains of the fat: operators against differences and dense algebra, and a fit to a known shape."""

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation
from tests.mesh.shapes import box_tets
from trimesh import Trimesh

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Region
from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements import plasticity
from handpipe.fem.solver.settling import Limits, Settled
from handpipe.mesh.tets.operators import gradient_operator, tet_laplacian
from handpipe.tissues.fat import strains
from handpipe.tissues.fat.resting.from_starts import settled_from
from handpipe.tissues.fat.resting.load_case import LoadCase
from handpipe.tissues.fat.strains import (
    ON_THE_WAY,
    FatState,
    FitSettings,
    _direction,
    fit_strains,
    strain_operator,
)

from .limb import LENGTH, at_rest, below, limb


def _log_strains(mesh, x):
    """Logarithms (m, 6) of the symmetric factors of the deformation gradients."""
    f = (gradient_operator(mesh.vertices, mesh.tets) @ x.ravel()).reshape(-1, 3, 3)
    return plasticity.log(plasticity.polar(f)[1])


@pytest.mark.parametrize("stretch, tolerance", [(1.0, 1e-7), (1.1, 2e-2)])
def test_strain_operator_is_the_change_of_the_logarithm(stretch, tolerance):
    mesh = box_tets(2)
    turn = Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
    x = (mesh.vertices * [stretch, 1.0, 1 / stretch]) @ turn.T
    direction = np.random.default_rng(0).normal(size=x.shape)
    step = 1e-6
    slope = (_log_strains(mesh, x + step * direction) - _log_strains(mesh, x - step * direction)) / (2 * step)
    found = (strain_operator(mesh, x) @ direction.ravel()).reshape(-1, 6)
    np.testing.assert_allclose(found, slope, atol=tolerance * np.abs(slope).max())


def test_rotations_strain_nothing():
    mesh = box_tets(2)
    turn = Rotation.from_rotvec([0.2, 1.5, -0.3]).as_matrix()
    x = mesh.vertices @ turn.T
    spin = np.cross([0.3, -0.2, 0.9], x)
    assert np.abs(strain_operator(mesh, x) @ spin.ravel()).max() < 1e-12


def test_direction_minimises_the_linearised_objective():
    mesh = box_tets(2)
    rng = np.random.default_rng(1)
    n, m = len(mesh.vertices), len(mesh.tets)
    surface = mesh.boundary_vertices()
    flat = (3 * surface[:, None] + np.arange(3)).ravel()
    skin = sparse.identity(3 * n, format="csr")[flat]
    normals = rng.normal(size=(len(surface), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    weights = rng.uniform(0.5, 1.5, len(surface))
    weights /= weights.sum()
    offsets, logs = 0.05 * rng.normal(size=len(surface)), 0.1 * rng.normal(size=(m, 6))
    settings = FitSettings(smoothness=0.3, hold=2.0)
    held = [Attachment(sparse.identity(n, format="csr")[:3], mesh.vertices[:3], 5.0)]
    strain = strain_operator(mesh, mesh.vertices)
    laplacian = sparse.kron(tet_laplacian(mesh.tets), sparse.identity(6), format="csr")
    now = FatState(logs, mesh.vertices, offsets, normals, weights, 0.0)
    step = _direction(strain, laplacian, now, skin, held, settings)

    rough = laplacian.toarray() @ strain.toarray()
    gap = np.zeros((len(surface), 3 * n))
    for row, (vertex, normal) in enumerate(zip(surface, normals, strict=True)):
        gap[row, 3 * vertex : 3 * vertex + 3] = normal
    spring = np.zeros((9, 3 * n))
    spring[:, :9] = np.eye(9)
    rows = np.concatenate(
        [
            np.sqrt(settings.smoothness / m) * rough,
            np.sqrt(weights)[:, None] * gap,
            np.sqrt(settings.hold / 9) * spring,
        ]
    )
    right = -np.concatenate(
        [
            np.sqrt(settings.smoothness / m) * (laplacian @ logs.ravel()),
            np.sqrt(weights) * offsets,
            np.zeros(9),
        ]
    )
    expected = np.linalg.lstsq(rows, right, rcond=None)[0]
    np.testing.assert_allclose(step.ravel(), expected, atol=1e-4 * np.abs(expected).max())


def _bulged(points):
    """A smooth map: the limb's distal half swells by up to 12 %, its proximal tip stays."""
    x = points[:, 0]
    grow = 0.12 * np.exp(-(((x - 3.0) / (0.3 * LENGTH)) ** 2))
    return points * np.column_stack([np.ones_like(x), 1 + grow, 1 + 0.5 * grow])


def _fit(**settings):
    tissue = limb(Region.fixed)
    scan = tissue.skin.moved(_bulged(tissue.skin.vertices))
    wanted = FitSettings(**settings)
    return tissue, fit_strains(tissue, below(), at_rest(), scan, tissue.mesh.vertices, wanted)


def test_the_skin_comes_to_lie_on_the_scan():
    tissue, fit = _fit()
    gaps = [row["mean_gap"] for row in fit.record]
    values = [row["objective"] for row in fit.record]
    assert gaps[0] > 0.15
    assert gaps[-1] < 0.02
    assert all(b < a for a, b in zip(values, values[1:], strict=False))
    principal = plasticity.eigenvalues(plasticity.exp(fit.log_strains))
    assert principal.min() > 0.5 and principal.max() < 2.0
    # what comes back is an equilibrium under its strains, not a shape that was pulled there
    x = settled_from(LoadCase.of(tissue, below(), at_rest(), plasticity.exp(fit.log_strains)), fit.vertices).x
    np.testing.assert_allclose(x, fit.vertices, atol=5e-3)


def test_a_fit_tells_whether_its_equilibrium_may_be_trusted():
    tissue, fit = _fit()
    rest, tets = tissue.mesh.vertices, tissue.mesh.tets
    det = np.linalg.det((gradient_operator(rest, tets) @ fit.vertices.ravel()).reshape(-1, 3, 3))
    assert fit.figures["least_det"] == pytest.approx(det.min(), rel=1e-9)
    assert fit.figures["inverted_tets"] == fit.figures["tangles"] == fit.figures["unsettled"] == 0
    assert fit.figures["contact_motion"] < ON_THE_WAY.settled
    assert 0 <= fit.figures["residual"] < 1.0


def test_a_fit_whose_contact_is_unsettled_says_so(monkeypatch):
    monkeypatch.setattr(strains, "ON_THE_WAY", Limits(renewals=1, settled=1e-12, gross=np.inf))
    figures = _fit()[1].figures
    assert figures["unsettled"] == 1 and figures["contact_motion"] > 1e-12


@pytest.mark.parametrize("settings", [{"iterations": 1}, {"least_step": 2.0}], ids=["few", "no step"])
def test_a_fit_that_has_not_converged_says_so_and_how_far_off_it_is(settings):
    tissue, fit = _fit(**settings)
    scan = Trimesh(_bulged(tissue.skin.vertices), tissue.skin.triangles, process=False)
    rest = Trimesh(tissue.skin.vertices, tissue.skin.triangles, process=False)
    gaps = scan.nearest.on_surface(tissue.skin_matrix @ fit.vertices)[1]
    assert fit.figures["unfinished"] == 1
    shares = np.bincount(rest.faces.ravel(), np.repeat(rest.area_faces, 3))
    shares[np.concatenate([part.vertices for part in tissue.rigid.values()])] = 0.0  # are not pulled
    assert fit.figures["mean_gap"] == pytest.approx(np.average(gaps, weights=shares), rel=0.03)


def test_a_fit_that_has_converged_does_not():
    figures = _fit()[1].figures
    assert figures["unfinished"] == 0 and figures["mean_gap"] < 0.005


def test_a_fit_with_an_inverted_tet_fails_and_names_the_place(monkeypatch):
    def inverted(case, *arguments):
        x = case.tissue.mesh.vertices.copy()
        a, b, c, d = case.tissue.mesh.tets[0]
        x[a] += 2.5 * (x[[b, c, d]].mean(axis=0) - x[a])
        return Settled(x, 1, 0.0)

    monkeypatch.setattr(strains, "settled_from", inverted)
    with pytest.raises(ConvergenceError, match=r"fat in fist .*inverted.* mm has det F .* from core"):
        fit_strains(
            limb(), below(), at_rest(), limb().skin, limb().mesh.vertices, FitSettings(), "fat in fist"
        )


def test_the_same_inputs_give_the_same_strains():
    np.testing.assert_array_equal(_fit()[1].log_strains, _fit()[1].log_strains)


def test_a_scan_that_already_fits_asks_for_no_strain():
    tissue = limb(Region.fixed)
    fit = fit_strains(tissue, below(), at_rest(), tissue.skin, tissue.mesh.vertices, FitSettings())
    assert np.abs(fit.log_strains).max() < 1e-6


def test_no_tet_is_strained_by_much_in_one_iteration():
    tissue = limb(Region.fixed)
    scan = tissue.skin.moved(tissue.skin.vertices * [1.0, 1.5, 1.5])  # 3 mm outside of 4 mm of tissue
    fits = [
        fit_strains(tissue, below(), at_rest(), scan, tissue.mesh.vertices, FitSettings(iterations=n))
        for n in (1, 6)
    ]
    once, often = (np.sqrt((fit.log_strains**2 @ [1.0, 2, 2, 1, 2, 1]).max()) for fit in fits)
    largest = FitSettings().largest_change
    assert once <= largest * (1 + 1e-9)
    assert once > 0.9 * largest  # the scan asks for more, and
    assert often > 2 * largest  # gets it in time
    assert fits[1].record[-1]["mean_gap"] < 0.2 * fits[1].record[0]["mean_gap"]
