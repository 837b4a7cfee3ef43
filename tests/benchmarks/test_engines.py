"""The truth by another engine: its law's derivatives, its deck, and CalculiX's equilibria."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from benchmarks.truth import calculix, engines, touching
from benchmarks.truth.calculix import ITS_SIDES, PROGRAM, Deck
from benchmarks.truth.engines import engine_differences
from benchmarks.truth.isochoric import IsochoricSolid
from benchmarks.truth.touching import RADIUS, Fingertips, contact_differences, fingertips
from tests.fem.bodies import box

from handpipe.core.errors import InputError
from handpipe.fem.elements.materials import Material
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.continuum.solid import Solid

ELEMENTS = Elements.quadratic(TetMesh(*box((2.0, 1.0, 1.0), (2, 1, 1))))
MATERIAL = Material(np.linspace(1, 6, len(ELEMENTS.cells)), 0.45)
needs_calculix = pytest.mark.skipif(PROGRAM is None, reason="CalculiX is not installed")


def deformed():
    return 1.1 * ELEMENTS.nodes + 0.08 * np.random.default_rng(5).normal(size=ELEMENTS.nodes.shape)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives_of_the_law_agree_with_differences(seed):
    law, x, step = IsochoricSolid(ELEMENTS, MATERIAL), deformed(), 1e-5
    d = np.random.default_rng(seed).normal(size=x.shape)
    slope = (law.value(x + step * d) - law.value(x - step * d)) / (2 * step)
    gradient = law.gradient(x)
    assert abs(slope - (gradient * d).sum()) < 1e-7 * np.linalg.norm(gradient) * np.linalg.norm(d)
    change = (law.gradient(x + step * d) - law.gradient(x - step * d)) / (2 * step)
    product = law.hessian(x) @ d.ravel()
    assert np.linalg.norm(change.ravel() - product) < 1e-6 * np.linalg.norm(product)


def test_the_law_is_the_truths_at_small_strains_and_refuses_inverted_tissue():
    law, x = IsochoricSolid(ELEMENTS, MATERIAL), deformed()
    rest = Solid(ELEMENTS, MATERIAL).hessian(ELEMENTS.nodes).toarray()
    np.testing.assert_allclose(law.hessian(ELEMENTS.nodes).toarray(), rest, atol=1e-10 * np.abs(rest).max())
    assert np.abs(law.gradient(ELEMENTS.nodes)).max() < 1e-10
    values = np.linalg.eigvalsh(law.hessian(x, True).toarray())
    assert values[0] > -1e-9 * values[-1]
    assert law.value(x * [1, 1, -1]) == np.inf


def test_the_deck_has_its_order_of_nodes(tmp_path: Path):
    law = IsochoricSolid(ELEMENTS, MATERIAL)
    held = ELEMENTS.nodes[:, 0] == 0
    deck = Deck(ELEMENTS.nodes, ELEMENTS.cells, law.moduli, held, [ELEMENTS.nodes])
    deck.write(tmp_path / "deck.inp")
    mesh = meshio.read(tmp_path / "deck.inp", file_format="abaqus")
    cells = mesh.cells_dict["tetra10"]
    np.testing.assert_array_equal(cells[:, :4], ELEMENTS.cells[:, :4])
    middles = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    for place, ends in enumerate(middles, start=4):
        middle = mesh.points[cells[:, ends]].mean(axis=1)
        np.testing.assert_allclose(mesh.points[cells[:, place]], middle, atol=1e-12)


@needs_calculix
def test_calculix_solves_the_toy_as_we_do():
    """Its table has seven digits of displacements up to 20 mm; the laws agree where strains are small."""
    found = {name: value for name, (value, _) in engine_differences(6.5, [2.0, 40.0]).items()}
    assert found["engine_displacement_max"] > 15.0
    assert found["engine_difference_mean"] < 3e-6 and found["engine_difference_max"] < 2e-5
    assert 1e-3 < found["engine_law_difference_mean"] < 0.02 and found["engine_law_difference_max"] < 0.1
    assert found["engine_law_difference_mean_2_degrees"] < 1e-4
    assert found["engine_difference_max_2_degrees"] < 2e-6


def test_the_surfaces_in_contact_are_the_skins():
    tips = Fingertips(fingertips(3.5))
    mesh, sides = tips.anatomy.mesh, {1: (0, 1, 2), 2: (0, 1, 3), 3: (1, 2, 3), 4: (0, 2, 3)}  # of CalculiX
    for rows, tip in zip(tips._sides(), (0, 1), strict=True):
        assert (tips.anatomy.labels[rows[:, 0]] == tip).all()
        faces = np.array([mesh.tets[cell][list(sides[ITS_SIDES[corner]])] for cell, corner in rows.tolist()])
        own = np.unique(mesh.tets[tips.anatomy.labels == tip])
        points = mesh.vertices - mesh.vertices[own].mean(axis=0)
        points[:, tip] = np.maximum(np.abs(points[:, tip]) - 3.0, 0.0)
        np.testing.assert_allclose(np.linalg.norm(points[faces], axis=2), RADIUS, atol=0.3)
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed


def test_without_calculix_figures_are_left_out(monkeypatch, tmp_path: Path):
    for module in (calculix, engines, touching):
        monkeypatch.setattr(module, "PROGRAM", None)
    assert engine_differences(6.0, [2.0]) == {} and contact_differences(2.5) == {}
    law = IsochoricSolid(ELEMENTS, MATERIAL)
    deck = Deck(ELEMENTS.nodes, ELEMENTS.cells, law.moduli, ELEMENTS.nodes[:, 0] == 0, [ELEMENTS.nodes])
    with pytest.raises(InputError, match="not installed"):
        deck.run(tmp_path)


@needs_calculix
def test_fingertips_touch_alike():
    """The barrier acts between flat triangles, CalculiX's contact between quadratic faces of 2.5 mm."""
    found = {name: value for name, (value, _) in contact_differences(2.5, refined=False).items()}
    assert 70 < found["engine_contact_force"] < 110
    assert found["engine_contact_force_difference"] < 1.0
    assert found["engine_contact_difference_mean"] < 0.03
    assert found["engine_contact_surface_difference_mean"] < 0.06
    assert found["engine_contact_difference_max"] < 0.3
