"""Functions by the factor that is kept, against the whole system solved by another library."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy import sparse
from scipy.sparse.linalg import spsolve
from tests.anatomy.arm import THREE_MUSCLES, arm

from handpipe.anatomy.editing.greens_matrix import GreensMatrix
from handpipe.anatomy.editing.kept_functions import KeptFunctions
from handpipe.anatomy.templates.curves import CurveFile, PlacedMuscle, place
from handpipe.anatomy.templates.diffusion import WEIGHT, Collocation, diffuse, stiffness, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.core.errors import InputError
from handpipe.mesh.tets.embedding import Locator

SURFACES = arm(5.0)


@pytest.fixture(scope="module")
def domain() -> Domain:
    return Domain.between(*SURFACES, 5.0)


def placed(edits: dict[str, object] | None = None) -> dict[str, PlacedMuscle]:
    """The arm's muscles, the flexor's middle point with other fields."""
    content = yaml.safe_load(THREE_MUSCLES)
    flexor = content["muscles"]["flexor"]["curves"][0]
    flexor["points"][1] |= edits or {}
    flexor["normal"] = [0, 1, 0]
    return place(CurveFile.model_validate(content), SURFACES[1], 0.5)


def whole(domain: Domain, muscles: dict[str, PlacedMuscle], fat: float) -> np.ndarray:
    """K + B^T W B assembled and solved, column by column: Eq. 10 to 12 as they stand."""
    mesh, locator = domain.mesh, Locator(domain.mesh)
    matrix, right = stiffness(mesh), {}
    for name, muscle in muscles.items():
        curve = Collocation.sample(muscle.curves, locator)
        weighted = curve.matrix(mesh).T @ sparse.diags(WEIGHT * curve.lengths)
        matrix, right[name] = matrix + weighted @ curve.matrix(mesh), weighted @ curve.tissue
    free = np.setdiff1d(np.arange(len(mesh.vertices)), domain.skin)
    values = np.zeros((len(mesh.vertices), 1 + len(muscles)))
    values[domain.skin, 0] = fat
    loads = [-(matrix @ values[:, 0]), *right.values()]
    for column, load in enumerate(loads):
        values[free, column] = spsolve(matrix[free][:, free].tocsc(), load[free])
    return values


EDITS = (
    {"at": [0, 0, -13.5]},  # dragged
    {"tissue": 0.6},
    {"at": [3, 2, -11], "tissue": 2.0},
)


def test_edits_give_the_functions_of_the_whole_system(domain: Domain) -> None:
    kept, muscles = KeptFunctions(domain), placed()
    np.testing.assert_allclose(kept.of(muscles, 0.3).values, whole(domain, muscles, 0.3), atol=1e-12)
    for edit in EDITS:
        muscles = {**muscles, "flexor": placed(edit)["flexor"]}
        functions = kept.of(muscles, 0.3)
        assert functions.names == ("fat", "flexor", "extensor", "abductor")
        np.testing.assert_allclose(functions.values, whole(domain, muscles, 0.3), atol=1e-12)
    np.testing.assert_allclose(functions.values, diffuse(domain, muscles, 0.3).values, atol=0.51e-6)


def test_muscles_come_and_go_and_the_fat_changes(domain: Domain) -> None:
    kept, muscles = KeptFunctions(domain), placed()
    kept.of(muscles, 0.3)
    two = {n: m for n, m in muscles.items() if n != "extensor"}
    np.testing.assert_allclose(kept.of(two, 0.5).values, whole(domain, two, 0.5), atol=1e-12)
    again = {"extensor": muscles["extensor"], **two}
    np.testing.assert_allclose(kept.of(again, 0.5).values, whole(domain, again, 0.5), atol=1e-12)
    alone = kept.of({}, 0.7)
    assert alone.names == ("fat",)
    np.testing.assert_array_equal(alone.values, 0.7)


def test_a_muscle_with_spread_gets_its_own_diffusion(domain: Domain) -> None:
    kept = KeptFunctions(domain)
    kept.of(placed(), 0.3)
    muscles = placed({"spread": [0.4, 2.5]})
    np.testing.assert_allclose(
        kept.of(muscles, 0.3).values, diffuse(domain, muscles, 0.3).values, atol=0.51e-6
    )
    other = {**muscles, "abductor": replace(muscles["abductor"], curves=muscles["extensor"].curves)}
    del other["extensor"]
    np.testing.assert_allclose(kept.of(other, 0.3).values, diffuse(domain, other, 0.3).values, atol=0.51e-6)


def test_the_domain_is_factorised_once_and_known_columns_are_not_solved_for_again(domain: Domain) -> None:
    made, columns = [], []

    class Counted:
        def __init__(self, matrix: sparse.csr_matrix) -> None:
            made.append(matrix.shape)
            self.factor = superlu(matrix)

        def solve(self, b: np.ndarray) -> np.ndarray:
            columns.append(b.shape[1])
            return self.factor.solve(b)

    kept, muscles = KeptFunctions(domain, factorise=Counted), placed()
    kept.of(muscles, 0.3)
    all_columns = sum(columns)
    columns.clear()
    kept.of({**muscles, "flexor": placed({"at": [0, 0, -12.1]})["flexor"]}, 0.3)
    assert sum(columns) < all_columns / 3  # the flexor's new vertices, and the four functions
    columns.clear()
    kept.of({**muscles, "flexor": placed({"at": [0, 0, -12.1], "tissue": 2})["flexor"]}, 0.3)
    assert columns == [1]
    columns.clear()
    kept.of(muscles, 0.3)  # undone
    assert columns == [4]
    assert len(made) == 1


def test_entries_stay_right_when_old_ones_are_forgotten(
    domain: Domain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("handpipe.anatomy.editing.greens_matrix.ROOM", 30)
    greens = GreensMatrix(stiffness(domain.mesh), domain.skin, superlu)
    free, random = greens.free, np.random.default_rng(0)
    dense = np.linalg.inv(stiffness(domain.mesh)[free][:, free].toarray())
    for _ in range(6):
        rows = random.choice(len(free), 20, replace=False)
        np.testing.assert_allclose(greens.between(free[rows]), dense[np.ix_(rows, rows)], atol=1e-12)
    assert greens.between(domain.skin[:2]).tolist() == [[0, 0], [0, 0]]


def test_a_muscle_outside_is_named_and_the_next_edit_is_right(domain: Domain) -> None:
    kept, muscles = KeptFunctions(domain), placed()
    kept.of(muscles, 0.3)
    away = muscles["flexor"].curves[0]
    lost = replace(muscles["flexor"], curves=(replace(away, points=away.points + 500),))
    with pytest.raises(InputError, match="muscles.flexor"):
        kept.of({**muscles, "flexor": lost}, 0.3)
    np.testing.assert_allclose(kept.of(muscles, 0.3).values, whole(domain, muscles, 0.3), atol=1e-12)
