"""What the solver hands on as converged is at rest everywhere; what cannot be at rest is refused by name."""

import numpy as np
import pytest
import scipy.sparse as sp
from benchmarks.trust import solver as trust
from benchmarks.trust.solver_scenes import draw
from tests.fem.bodies import box, box_surface, sphere

from handpipe.core.errors import ConvergenceError, InputError
from handpipe.fem.contact.barrier import Barrier
from handpipe.fem.contact.constraints import Attachment, Contact, Sliding
from handpipe.fem.contact.surface_contact import SurfaceContact
from handpipe.fem.elements.materials import Material
from handpipe.fem.minimisation.opening import NEARLY, opened
from handpipe.fem.potentials.cloth import Membrane
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.potential import Sum
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh

VERTICES, TETS = box((4.0, 1.0, 1.0), (8, 2, 2))
ROOT, TIP = VERTICES[:, 0] < 1e-9, VERTICES[:, 0] > 4 - 1e-9
SOFT = Material(6.0, 0.45)
UP = np.array([0.0, 0.0, 1.0])
NEAR = 0.05


def _every(x):
    return sp.eye(len(x), format="csr")


def _tip_load(force):
    return Pull(_every(VERTICES)[TIP], np.tile(force, (int(TIP.sum()), 1)))


@pytest.mark.parametrize("stiffness", [1e9, 1e11, 1e13, 1e15])
def test_a_bar_on_stiff_springs_bends_as_one_with_a_fixed_root(stiffness):
    body, load = Elastic(VERTICES, TETS, SOFT), _tip_load([0, 0, -0.003])
    springs = Attachment(_every(VERTICES)[ROOT], VERTICES[ROOT], stiffness)
    found = solve([body, springs, load], VERTICES)
    expected = solve([body, load], VERTICES, fixed=np.repeat(ROOT, 3))
    assert abs(expected.x - VERTICES).max() > 0.3
    np.testing.assert_allclose(found.x, expected.x, atol=1e-6)


def test_a_fixed_face_that_nearly_touches_hides_no_load():
    body, load = Elastic(VERTICES, TETS, SOFT), _tip_load([0, 0, 1e-3])
    plate = box_surface((1.2, 3.0, 1.0), (-1.2 - 1e-6, -1.0, 0.0))
    faces = TetMesh(VERTICES, TETS).boundary_faces()[0]
    barrier = Barrier(_every(VERTICES), faces, VERTICES, NEAR, 6.0, obstacle=plate)
    fixed = np.repeat(ROOT, 3)
    found = solve([body, barrier, load], VERTICES, fixed=fixed)
    expected = solve([body, load], VERTICES, fixed=fixed)
    np.testing.assert_allclose(found.x, expected.x, atol=1e-3 * abs(expected.x - VERTICES).max())


@pytest.mark.parametrize("gap", [1e-4, 1e-8])
def test_a_gap_that_nearly_closes_is_opened_first(gap):
    faces = TetMesh(VERTICES, TETS).boundary_faces()[0]
    table = box_surface((9.0, 3.0, 1.0), (-1.0, -1.0, -1.0 - gap * NEAR))
    barrier = Barrier(_every(VERTICES), faces, VERTICES, NEAR, 6.0, obstacle=table)
    free = np.ones(VERTICES.size, dtype=bool)
    x = opened(Sum([Elastic(VERTICES, TETS, SOFT), barrier]), VERTICES, free, "bar")
    assert barrier.gap(x) >= NEARLY * NEAR > barrier.gap(VERTICES)
    assert abs(x - VERTICES).max() < NEAR


def test_pins_are_released_where_contact_closes():
    """Nothing resists a cloth's rigid motions until it lies on what is inside it."""
    vertices, triangles = sphere(6.0, 2)
    inner = Distance(Surface(*sphere(5.0, 4)))
    cloth = Membrane(vertices, triangles, Material(0.1, 0.48), thickness=1.0, scale=0.4)
    contact = SurfaceContact(_every(vertices), inner, 100.0, onset=0.01)
    x = solve([cloth, contact], vertices).x
    forces = np.linalg.norm(contact.gradient(x), axis=1)
    assert np.linalg.norm(cloth.gradient(x) + contact.gradient(x), axis=1).max() < 1e-4 * forces.max()


def _with_stray(points):
    return np.vstack([VERTICES, np.asarray(points, dtype=float)])


def test_a_load_on_an_orphan_vertex_is_refused():
    x = _with_stray([[9, 9, 9]])
    springs = Attachment(_every(x)[np.flatnonzero(ROOT)], VERTICES[ROOT], 1e3)
    weight = Pull(_every(x), np.tile([0, 0, -1e-3], (len(x), 1)))
    with pytest.raises(ConvergenceError, match=r"\(0, 0, -0.001\) mN on vertex 81, which no element has"):
        solve([Elastic(x, TETS, SOFT), springs, weight], x)


def test_a_stray_tet_under_gravity_is_refused():
    x = _with_stray([[9, 9, 9], [10, 9, 9], [9, 10, 9], [9, 9, 10]])
    tets = np.vstack([TETS, len(VERTICES) + np.arange(4)])
    springs = Attachment(_every(x)[np.flatnonzero(ROOT)], VERTICES[ROOT], 1e3)
    weight = Pull(_every(x), np.tile([0, 0, -1e-3], (len(x), 1)))
    with pytest.raises(ConvergenceError, match=r"nothing resists .*vertices 81, 82, 83, 84 \(4 in all"):
        solve([Elastic(x, tets, SOFT), springs, weight], x)


def test_a_load_along_sliding_planes_is_refused_and_across_them_carried():
    lowest = VERTICES[:, 2] < 1e-9
    planes = Sliding(_every(VERTICES)[lowest], VERTICES[lowest], np.tile(UP, (int(lowest.sum()), 1)), 100.0)
    body = Elastic(VERTICES, TETS, SOFT)
    down = Pull(_every(VERTICES), np.tile([0, 0, -1e-3], (len(VERTICES), 1)))
    found = solve([body, planes, down], VERTICES)
    assert planes.gradient(found.x).sum(axis=0)[2] == pytest.approx(-1e-3 * len(VERTICES), rel=1e-6)
    along = Pull(_every(VERTICES), np.tile([1e-3, 0, -1e-3], (len(VERTICES), 1)))
    with pytest.raises(ConvergenceError, match=r"nothing resists the net force \(0.081, "):
        solve([body, planes, along], VERTICES)


@pytest.mark.parametrize("gap", [0.03, 0.1])
def test_a_block_that_slides_off_another_is_named(gap):
    lower, first = box((2.0, 2.0, 1.0), (3, 3, 2))
    upper, second = box((1.0, 1.0, 1.0), (2, 2, 2))
    x = np.vstack([lower, upper + [0.5, 0.5, 1.0 + gap]])
    tets = np.vstack([first, second + len(lower)])
    side = np.where(np.arange(len(x))[:, None] >= len(lower), [0.01, 0.0, -0.001], 0.0)
    barrier = Barrier(_every(x), TetMesh(x, tets).boundary_faces()[0], x, NEAR, 6.0)
    with pytest.raises(ConvergenceError, match="the body of vertices 48, .* has moved"):
        solve([Elastic(x, tets, SOFT), Pull(_every(x), side), barrier], x, fixed=np.repeat(x[:, 2] < 1e-9, 3))


def test_a_block_above_a_floor_falls_onto_it():
    lowest = VERTICES[:, 2] < 1e-9
    ups = np.tile(UP, (int(lowest.sum()), 1))
    floor = Contact(_every(VERTICES)[lowest], VERTICES[lowest] - 0.5 * UP, ups, 100.0)
    weight = Pull(_every(VERTICES), np.tile([0, 0, -1e-3], (len(VERTICES), 1)))
    found = solve([Elastic(VERTICES, TETS, SOFT), floor, weight], VERTICES)
    assert floor.gradient(found.x).sum(axis=0)[2] == pytest.approx(-1e-3 * len(VERTICES), rel=1e-6)


def test_weak_springs_are_no_rounding():
    """They are a ten-millionth of a millionth of the tets' stiffness, and all that resists."""
    springs = Attachment(_every(VERTICES), VERTICES + UP, 1e-9)
    found = solve([Elastic(VERTICES, TETS, SOFT), springs], VERTICES)
    np.testing.assert_allclose(found.x, VERTICES + UP, atol=1e-4)


def test_a_start_that_is_no_number_is_refused():
    x = VERTICES.copy()
    x[5, 1] = np.nan
    with pytest.raises(InputError, match=r"bar: x: vertex 5 is not finite \(1 in all\)"):
        solve([Elastic(VERTICES, TETS, SOFT)], x, fixed=np.repeat(ROOT, 3), options=Options(name="bar"))


@pytest.mark.parametrize("field", ["displacement_tolerance", "force_tolerance", "max_step", "max_iterations"])
@pytest.mark.parametrize("value", [float("nan"), -1.0])
def test_options_that_mean_nothing_are_refused(field, value):
    with pytest.raises(InputError, match=field):
        Options(**{field: value})


def test_numbers_that_are_none_are_refused_where_they_enter():
    every, bad = _every(VERTICES), VERTICES.copy()
    bad[3] = np.inf
    for make in (
        lambda: Attachment(every, bad, 1.0),
        lambda: Pull(every, bad),
        lambda: Elastic(bad, TETS, SOFT),
        lambda: Elastic(VERTICES, TETS, SOFT, weights=np.full(len(TETS), np.nan)),
        lambda: Material(float("nan"), 0.3),
        lambda: Material(6.0, float("nan")),
    ):
        with pytest.raises(InputError):
            make()


def test_tets_that_are_no_mesh_are_refused_by_name():
    repeated = np.vstack([TETS, TETS[7][[1, 2, 0, 3]]])
    with pytest.raises(InputError, match=f"tets 7 and {len(TETS)} have the same four vertices"):
        Elastic(VERTICES, repeated, SOFT)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 2]])
    three = np.array([[0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]])
    with pytest.raises(InputError, match=r"vertices 0, 1, 2 belongs to three tets or more \(0, 1, 2\)"):
        Elastic(corners, three, SOFT)
    with pytest.raises(InputError, match="quadratic tets"):
        Elastic(VERTICES, np.hstack([TETS, TETS, TETS[:, :2]]), SOFT)
    with pytest.raises(InputError, match="outside 0 to 80"):
        Elastic(VERTICES, np.vstack([TETS, [[0, 1, 2, 81]]]), SOFT)


def test_sizes_of_forces_are_those_of_single_elements():
    rng = np.random.default_rng(0)
    x = VERTICES + 0.05 * rng.normal(size=VERTICES.shape)
    expected = np.zeros(len(x))
    for tet in TETS:
        expected += np.linalg.norm(Elastic(VERTICES, tet[None], SOFT).gradient(x), axis=1)
    np.testing.assert_allclose(Elastic(VERTICES, TETS, SOFT).force_sizes(x), expected, rtol=1e-10)
    skin, triangles = sphere(1.0, 1)
    drawn = skin + 0.05 * rng.normal(size=skin.shape)
    expected = np.zeros(len(skin))
    for triangle in triangles:
        expected += np.linalg.norm(Membrane(skin, triangle[None], SOFT, 0.1).gradient(drawn), axis=1)
    found = Membrane(skin, triangles, SOFT, 0.1).force_sizes(drawn)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("number", range(42))
def test_random_scenes_are_at_rest(number):
    assert trust.judged(draw(number), number) == "balanced"


@pytest.mark.parametrize("number", range(6))
def test_random_scenes_without_an_equilibrium_are_refused(number):
    scene = draw(number, unsupported=True)
    with pytest.raises(ConvergenceError, match="nothing resists"):
        solve(scene.potentials(), scene.body.vertices)


@pytest.mark.parametrize("number", range(7))
def test_the_judge_sees_a_shape_that_is_not_at_rest(number):
    scene = draw(number)
    x = solve(scene.potentials(), scene.body.vertices).x
    assert not trust.unbalanced(scene, x)
    shift = np.abs(x - scene.body.vertices).max()
    moved = x + 0.01 * shift * np.random.default_rng(0).normal(size=x.shape)
    if scene.plate is not None:
        moved[:, 2] = np.maximum(moved[:, 2], x[:, 2])
    assert trust.unbalanced(scene, moved)
    assert trust.unbalanced(scene, scene.body.vertices)
