"""Input decks: meshio reads them, and CalculiX, where it is installed, finds our equilibrium."""

import shutil
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.fem.bodies import box

from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.solver import equilibrium
from handpipe.hand.exports.input_deck import STEPS, _in_steps, write_deck
from handpipe.mesh.tets.tetrahedra import TetMesh

CCX = shutil.which("ccx")
TURN = Rotation.from_rotvec([0.3, 1.2, -0.5])


def bent(size: float, poisson: float, weights=None) -> tuple[Elastic, np.ndarray]:
    """A block, its surface displaced by a smooth field of a size, turned far, and our equilibrium."""
    vertices, tets = box((6.0, 3.0, 3.0), (6, 3, 3))
    elastic = Elastic(vertices, tets, Material(8.0, poisson), weights=weights)
    x = vertices + size * np.column_stack(
        [np.sin(vertices[:, 1]), 0.3 * vertices[:, 0], np.cos(vertices[:, 0]) * vertices[:, 2]]
    )
    fixed = np.zeros((len(x), 3), bool)
    fixed[TetMesh(vertices, tets).boundary_vertices()] = True
    found = equilibrium.solve([elastic], TURN.apply(x) + [5.0, -3.0, 2.0], fixed=fixed)
    return elastic, found.x


def ccx(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (n, 3) and stresses (m, 6: xx, yy, zz, xy, xz, yz) at the end of a deck."""
    done = subprocess.run([CCX, "deck"], cwd=folder, capture_output=True, text=True, timeout=120, check=True)
    assert "*ERROR" not in done.stdout
    blocks = [[]]
    for line in (folder / "deck.dat").read_text().splitlines():
        if "displacements" in line or "stresses" in line:
            blocks.append([])
        elif line.strip():
            blocks[-1].append([float(v) for v in line.split()])
    moves, stresses = (np.array(b) for b in blocks[-2:])
    return moves[np.argsort(moves[:, 0]), 1:], stresses[np.argsort(stresses[:, 0]), 2:]


def read(folder: Path) -> meshio.Mesh:
    return meshio.read(folder / "deck.inp", file_format="abaqus")


def test_the_deck_has_the_tets_at_rest_and_the_places_of_the_boundary(tmp_path: Path):
    elastic, x = bent(0.1, 0.3)
    write_deck(tmp_path / "deck.inp", elastic, x, "block")
    text = (tmp_path / "deck.inp").read_text()
    mesh = read(tmp_path)
    np.testing.assert_array_equal(mesh.cells_dict["tetra"], elastic.tets)
    edges = elastic.tets[:, [0, 1]]
    lengths = [
        np.linalg.norm(p[edges[:, 1]] - p[edges[:, 0]], axis=1) for p in (mesh.points, elastic.vertices)
    ]
    np.testing.assert_allclose(*lengths)
    rows = text.split("*BOUNDARY\n")[1].split("*")[0].splitlines()
    moved = mesh.points.copy()
    for node, first, last, value in (row.split(",") for row in rows):
        assert first == last
        moved[int(node) - 1, int(first) - 1] += float(value)
    boundary = TetMesh(elastic.vertices, elastic.tets).boundary_vertices()
    np.testing.assert_allclose(moved[boundary], x[boundary], atol=1e-12)
    fields = [field.strip() for row in text.splitlines()[3:] for field in row.split(",")]
    assert max(map(len, fields)) <= 20  # CalculiX reads no more of a field, and refuses a longer exponent
    c10, d1 = (float(v) for v in text.split("NEO HOOKE\n")[1].splitlines()[0].split(","))
    assert 2 * c10 == pytest.approx(8.0 / 2.6) and 2 / d1 == pytest.approx(8.0 / 3 / (1 - 0.6))


@pytest.mark.skipif(CCX is None, reason="CalculiX is not installed")
@pytest.mark.parametrize(
    ("size", "poisson", "within"), [(1e-3, 0.3, 2e-3), (1e-3, 0.45, 2e-3), (0.05, 0.3, 0.05)]
)
def test_calculix_finds_our_equilibrium(size: float, poisson: float, within: float, tmp_path: Path):
    """At small strains the materials are the same; at 20 % they differ a little."""
    elastic, x = bent(size, poisson)
    write_deck(tmp_path / "deck.inp", elastic, x, "block")
    moves, stresses = ccx(tmp_path)
    placed = read(tmp_path).points
    inner = np.setdiff1d(np.arange(len(x)), TetMesh(elastic.vertices, elastic.tets).boundary_vertices())
    assert len(inner) == 20
    own = (x - placed)[inner]
    assert np.abs(moves[inner] - own).max() < within * np.abs(own).max()
    expected = elastic.cauchy_stresses(x)[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    assert np.abs(stresses - expected).max() < 3 * within * np.abs(expected).max()


@pytest.mark.skipif(CCX is None, reason="CalculiX is not installed")
def test_shares_of_tissue_scale_the_material(tmp_path: Path):
    shares = np.where(np.arange(324) % 3, 1.0, 0.25)
    elastic, x = bent(1e-3, 0.3, shares)
    write_deck(tmp_path / "deck.inp", elastic, x, "block")
    moves, stresses = ccx(tmp_path)
    own = x - read(tmp_path).points
    assert np.abs(moves - own).max() < 2e-3 * np.abs(own).max()
    expected = elastic.cauchy_stresses(x)[:, [0, 1, 2], [0, 1, 2]]
    assert np.abs(stresses[:, :3] - expected).max() < 6e-3 * np.abs(expected).max()


def test_moduli_of_many_values_are_rounded_by_less_than_a_twelfth():
    """Skin and fat in all shares, 20 to 1: the softest stay soft, and few materials are left."""
    moduli = 1.0 + 19.0 * np.random.default_rng(0).uniform(size=2000) ** 3
    rounded = _in_steps(moduli)
    assert len(np.unique(rounded)) <= STEPS + 1
    assert np.abs(rounded / moduli - 1).max() < 1 / 12
    assert _in_steps(moduli[:STEPS]).tolist() == moduli[:STEPS].tolist()
