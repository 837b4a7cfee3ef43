"""Few vertices that a Newton step is about: their part of the energy, and what their relaxation saves."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from handpipe.fem.contact.constraints import Attachment, Contact, Sliding
from handpipe.fem.contact.surface_contact import SurfaceContact
from handpipe.fem.contact.surface_sliding import SurfaceSliding
from handpipe.fem.elements.materials import Material
from handpipe.fem.minimisation import newton
from handpipe.fem.minimisation.few_vertices import few_vertices, with_neighbours
from handpipe.fem.potentials.cloth import Membrane
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.potential import Sum
from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh

from .bodies import box, sphere

VERTICES, TETS = box((6.0, 4.0, 2.0), (9, 6, 3))
N = len(VERTICES)
BALL = Surface(*sphere(3.0, 2))
EDGED = Distance(BALL.moved(BALL.vertices + [3.0, 2.0, -2.5]))
OTHER = Distance(BALL.moved(BALL.vertices + [3.0, 2.0, 4.5]))
RNG = np.random.default_rng(0)


def points(count: int) -> sp.csr_matrix:
    """Points that three vertices carry each."""
    rows, columns = np.repeat(np.arange(count), 3), RNG.integers(0, N, 3 * count)
    weights = RNG.dirichlet([1, 1, 1], count).ravel()
    return sp.csr_matrix((weights, (rows, columns)), shape=(count, N))


def potentials() -> dict[str, object]:
    operator, normals = points(60), RNG.normal(size=(60, 3))
    low = sp.eye(N, format="csr")[VERTICES[:, 2] < 1e-9]
    faces = TetMesh(VERTICES, TETS).boundary_faces()[0]
    strains = np.array([1.1, 0.02, 0.0, 0.95, 0.01, 1.0]) + 0.01 * RNG.normal(size=(len(TETS), 6))
    surfaces = [kind(low, d, 30.0) for kind in (SurfaceSliding, SurfaceContact) for d in (EDGED, OTHER)]
    return {
        "elastic": Elastic(VERTICES, TETS, Material(5.0, 0.47), strains, RNG.uniform(0.2, 1, len(TETS))),
        "membrane": Membrane(VERTICES, faces, Material(20.0, 0.3), 0.5, 0.8),
        "attachment": Attachment(operator, RNG.normal(size=(60, 3)), RNG.uniform(1, 9, 60)),
        "sliding": Sliding(operator, RNG.normal(size=(60, 3)), normals, RNG.uniform(1, 9, 60)),
        "contact": Contact(operator, RNG.normal(size=(60, 3)), normals, RNG.uniform(1, 9, 60)),
        "surface_sliding": SurfaceSliding.stacked(surfaces[:2])[0],
        "surface_contact": SurfaceContact.stacked(surfaces[2:])[0],
    }


@pytest.mark.parametrize("name", list(potentials()))
def test_the_part_changes_as_the_whole_does_where_few_vertices_move(name: str) -> None:
    whole = potentials()[name]
    x = VERTICES + 0.05 * RNG.normal(size=VERTICES.shape)
    moving = np.zeros(N, dtype=bool)
    moving[RNG.choice(N, 7, replace=False)] = True
    moving[np.argmin(np.linalg.norm(VERTICES - [3, 2, 0], axis=1))] = True
    kept = np.flatnonzero(with_neighbours(moving, whole.hessian(x)))
    assert len(kept) < N
    part, own = whole.near(moving, kept), moving[kept]
    assert part.value(x[kept]) <= whole.value(x) + 1e-9
    step = np.where(moving[:, None], 0.02 * RNG.normal(size=x.shape), 0.0)
    change = whole.value(x + step) - whole.value(x)
    assert abs(change) > 1e-6
    assert part.value((x + step)[kept]) - part.value(x[kept]) == pytest.approx(change, rel=1e-9)
    np.testing.assert_allclose(part.gradient(x[kept])[own], whole.gradient(x)[moving], atol=1e-9)
    rows, here = np.repeat(moving, 3), np.repeat(own, 3)
    columns = (3 * kept[:, None] + np.arange(3)).ravel()
    for project in (False, True):
        wanted = whole.hessian(x, project)[rows][:, columns].toarray()
        np.testing.assert_allclose(part.hessian(x[kept], project)[here].toarray(), wanted, atol=1e-8)


def test_an_energy_that_cannot_be_cut_has_no_part() -> None:
    moving = np.arange(N) < 3
    assert Sum([potentials()["elastic"], object()]).near(moving, np.arange(N)) is None


def test_a_step_of_many_vertices_is_not_about_few() -> None:
    hessian = potentials()["elastic"].hessian(VERTICES)
    step = RNG.normal(size=3 * N)
    assert few_vertices(step, hessian) is None
    assert few_vertices(np.zeros(3 * N), hessian) is None
    step *= 0.01
    step[30:33] = 1.0
    few = few_vertices(step, hessian)
    neighbours = np.unique(TETS[(TETS == 10).any(axis=1)])
    np.testing.assert_array_equal(np.flatnonzero(few), neighbours)


def pressed_by_a_ball() -> tuple[list[object], np.ndarray, np.ndarray]:
    """A soft block whose bottom is held, and of whose top 45 vertices slide on a stiff ball of facets."""
    vertices, tets = box((40.0, 40.0, 4.0), (30, 30, 2))
    top = (vertices[:, 2] > 3.9) & (np.linalg.norm(vertices[:, :2] - 20.0, axis=1) < 5.0)
    ball = Surface(*sphere(4.0, 1))
    ball = ball.moved(ball.vertices + [20.4, 20.3, 6.0])
    operator = sp.eye(len(vertices), format="csr")[np.flatnonzero(top)]
    parts = [Elastic(vertices, tets, Material(1.0, 0.4)), SurfaceSliding(operator, Distance(ball), 5000.0)]
    return parts, vertices, np.repeat(vertices[:, 2] < 1e-9, 3)


def test_steps_of_all_vertices_are_saved_where_few_meet_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    parts, x, fixed = pressed_by_a_ball()
    options = Options(displacement_tolerance=1e-4, force_tolerance=1e-4, untangle=False)
    found = solve(parts, x, fixed=fixed, options=options)
    monkeypatch.setattr(newton, "few_vertices", lambda *_: None)
    plain = solve(parts, x, fixed=fixed, options=options)
    assert found.record.relaxed > 0
    assert found.record.iterations <= plain.record.iterations / 2
    np.testing.assert_allclose(found.x, plain.x, atol=1e-6)
