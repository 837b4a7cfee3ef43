"""The solver: recovery from bad starts, contact, continuation, and honest failure."""

import logging

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box, box_surface, sphere

from handpipe.core.errors import ConvergenceError, InputError
from handpipe.fem.contact.barrier import Barrier, CollidingPairs
from handpipe.fem.contact.constraints import Attachment, Contact
from handpipe.fem.contact.surface_contact import SurfaceContact
from handpipe.fem.elements.materials import Material
from handpipe.fem.minimisation.checkpoint import Checkpoint
from handpipe.fem.potentials.cloth import Membrane
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver.equilibrium import Analyses, Options, Steps, continuation, solve
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

SIZE = (4.0, 1.0, 1.0)
VERTICES, TETS = box(SIZE, (8, 2, 2))
LEFT, RIGHT = VERTICES[:, 0] < 1e-9, VERTICES[:, 0] > SIZE[0] - 1e-9
SOFT = Material(6.0, 0.45)


@pytest.mark.parametrize(
    ("material", "scatter"), [(Material(6.0, 0.3), 0.6), (Material(6.0, 0.48, "stvk"), 0.2), (SOFT, 0.6)]
)
def test_scrambled_vertices_find_the_rest_shape(material, scatter):
    start = VERTICES + scatter * np.random.default_rng(0).normal(size=VERTICES.shape)
    start[LEFT] = VERTICES[LEFT]
    elastic = Elastic(VERTICES, TETS, material)
    assert elastic.tangles.count(start) > 0
    found = solve([elastic], start, fixed=np.repeat(LEFT, 3))
    np.testing.assert_allclose(found.x, VERTICES, atol=1e-5)
    assert found.record.untangled > 0 and found.record.tangles == 0


def _moved_back(x):
    """Positions with the rigid motion from VERTICES removed."""
    u, _, v = np.linalg.svd((x - x.mean(axis=0)).T @ (VERTICES - VERTICES.mean(axis=0)))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return (x - x.mean(axis=0)) @ turn + VERTICES.mean(axis=0)


def test_a_body_in_one_point_and_held_by_nothing_unfolds():
    found = solve([Elastic(VERTICES, TETS, SOFT)], np.zeros_like(VERTICES))
    assert found.record.escapes + found.record.untangled > 0
    np.testing.assert_allclose(_moved_back(found.x), VERTICES, atol=1e-5)


def _pressed(column, tets):
    """A column of 8 mm (n, 3): its elastic energy, pressed by 8 % along x, and what holds its ends (3 n,)."""
    ends = (column[:, 0] < 1e-9) | (column[:, 0] > 8 - 1e-9)
    return Elastic(column, tets, Material(6.0, 0.3)), column * [0.92, 1.0, 1.0], np.repeat(ends, 3)


def test_a_saddle_is_left():
    slender, tets = box((8.0, 0.5, 0.5), (32, 3, 3))
    elastic, pressed, held = _pressed(slender, tets)
    found = solve([elastic], pressed, fixed=held, options=Options(max_iterations=300))
    middle = np.abs(slender[:, 0] - 4) < 1e-9
    sideways = np.linalg.norm((found.x - pressed)[middle].mean(axis=0)[1:])
    # A clamped column bends to a cosine once shorter than by 4 pi^2 I / (A l^2), its critical strain.
    critical = 4 * np.pi**2 * (0.5**2 / 12) / 8**2
    assert sideways == pytest.approx(2 * 8 * np.sqrt(0.08 - critical) / np.pi, rel=0.1)
    assert np.linalg.eigvalsh(elastic.hessian(found.x).toarray()[~held][:, ~held])[0] > 0


def test_a_saddle_is_kept_where_the_options_accept_it():
    slender, tets = box((8.0, 0.5, 0.5), (32, 3, 3))
    elastic, pressed, held = _pressed(slender, tets)
    found = solve([elastic], pressed, fixed=held, options=Options(saddles=True))
    assert found.record.converged and found.record.escapes == 0
    np.testing.assert_allclose(found.x.mean(axis=0)[1:], pressed.mean(axis=0)[1:], atol=1e-6)  # straight
    assert np.linalg.eigvalsh(elastic.hessian(found.x).toarray()[~held][:, ~held])[0] < 0


def test_a_saddle_is_left_with_small_elements_right_side_out():
    """A tet of a pressed column is split close to its corner: its parts are a thousandth of its size."""
    slender, tets = box((8.0, 0.5, 0.5), (32, 3, 3))
    chosen = int(np.argmin(np.linalg.norm(slender[tets].mean(axis=1) - [4.0, 0.25, 0.25], axis=1)))
    corners = tets[chosen]
    shares = np.array([0.997, 0.001, 0.001, 0.001])
    slender = np.vstack([slender, shares @ slender[corners]])
    parts = np.tile(corners, (4, 1))
    np.fill_diagonal(parts, len(slender) - 1)
    tets = np.vstack([np.delete(tets, chosen, axis=0), parts])
    elastic, pressed, held = _pressed(slender, tets)
    options = Options(max_iterations=300, untangle=False)
    found = solve([elastic], pressed, fixed=held, options=options)
    assert found.record.escapes > 0 and found.record.tangles == 0
    assert max(found.record.residuals) < 100 * found.record.residuals[0]


def test_two_bodies_of_which_nothing_holds_one():
    vertices = np.concatenate([VERTICES, VERTICES + [0, 3, 0]])
    tets = np.concatenate([TETS, TETS + len(VERTICES)])
    rng = np.random.default_rng(0)
    forces = rng.normal(size=VERTICES.shape)
    forces = 1e-3 * (forces - forces.mean(axis=0))
    start = vertices + 0.05 * rng.normal(size=vertices.shape)
    start[: len(VERTICES)][LEFT] = VERTICES[LEFT]
    held = np.zeros(vertices.shape, bool)
    held[: len(VERTICES)][LEFT] = True
    found = solve([Elastic(vertices, tets, SOFT)], start, fixed=held)
    np.testing.assert_allclose(found.x[: len(VERTICES)], VERTICES, atol=1e-5)
    np.testing.assert_allclose(_moved_back(found.x[len(VERTICES) :]), VERTICES, atol=1e-5)


def test_a_body_that_nothing_holds_against_a_force_has_no_equilibrium():
    every = sp.eye(len(VERTICES), format="csr")
    weight = Pull(every, np.tile([0.0, 0.0, -0.01], (len(VERTICES), 1)))
    with pytest.raises(ConvergenceError):
        solve([Elastic(VERTICES, TETS, SOFT), weight], VERTICES, options=Options(max_iterations=20))


class _Killed(Exception):
    pass


def test_a_killed_continuation_goes_on_where_it_was(tmp_path):
    elastic, held = Elastic(VERTICES, TETS, SOFT), np.repeat(LEFT | RIGHT, 3)

    def run(die_after=np.inf):
        calls = []

        def potentials(t):
            calls.append(t)
            if len(calls) > die_after:
                raise _Killed
            return [elastic]

        checkpoint = Checkpoint(tmp_path / "bend.npz", every=0.0)
        found = continuation(potentials, VERTICES, fixed=held, prescribed=_bend, checkpoint=checkpoint)
        return found.x, calls

    whole, _ = run()
    assert not (tmp_path / "bend.npz").exists()
    with pytest.raises(_Killed):
        run(die_after=4)
    again, calls = run()
    assert min(t for t in calls[2:] if t > 0) > 0.2, "the first steps are not repeated"
    np.testing.assert_allclose(again, whole, atol=2e-4)
    (tmp_path / "bend.npz").write_bytes(b"half a file")
    np.testing.assert_allclose(run()[0], whole, atol=1e-12)


def test_a_checkpoint_of_another_problem_is_left_aside(tmp_path):
    checkpoint = Checkpoint(tmp_path / "state.npz")
    checkpoint.begin("one", VERTICES)
    checkpoint.save(VERTICES + 1)
    assert checkpoint.begin("two", VERTICES) is None
    load, step, x = checkpoint.begin("one", VERTICES)
    np.testing.assert_array_equal(x, VERTICES + 1)


def test_springs_carry_exactly_the_load():
    points = sp.eye(len(VERTICES), format="csr")
    load = np.array([0.0, 0.0, -0.02])
    forces = np.tile(load, (int(RIGHT.sum()), 1))
    springs = Attachment(points[LEFT], VERTICES[LEFT], 1e3)
    found = solve([Elastic(VERTICES, TETS, SOFT), springs, Pull(points[RIGHT], forces)], VERTICES)
    np.testing.assert_allclose(springs.gradient(found.x).sum(axis=0), forces.sum(axis=0), atol=1e-6)
    assert found.record.residuals[-1] < 1e-3 * np.linalg.norm(load)


def _bend(t):
    """The right end turned by 120 degrees and moved to where a circular arc would have it."""
    angle = max(t * 2 * np.pi / 3, 1e-9)
    radius = SIZE[0] / angle
    x = VERTICES.copy()
    offset = VERTICES[RIGHT] - [SIZE[0], 0.5, 0.5]
    c, s = np.cos(angle), np.sin(angle)
    turned = offset @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    x[RIGHT] = turned + [radius * s, 0.5 + radius * (1 - c), 0.5]
    return x


def test_continuation_bends_a_bar_and_does_not_depend_on_the_steps():
    elastic = Elastic(VERTICES, TETS, SOFT)
    held = np.repeat(LEFT | RIGHT, 3)
    shapes = [
        continuation(lambda t: [elastic], VERTICES, fixed=held, prescribed=_bend, steps=Steps(first=step)).x
        for step in (0.5, 0.2)
    ]
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-4)
    np.testing.assert_allclose(shapes[0][RIGHT], _bend(1.0)[RIGHT], atol=1e-12)
    assert np.linalg.det(elastic.deformation_gradients(shapes[0])).min() > 0
    interior = elastic.gradient(shapes[0])[~(LEFT | RIGHT)]
    assert np.abs(interior).max() < 1e-4 * np.abs(elastic.gradient(shapes[0])).max()


@pytest.mark.parametrize("elongation", [1.0, 1.6])  # the longer one slips off if a step passes the surface
def test_shrunk_cloth_lies_on_the_sphere_inside_it(elongation):
    vertices, triangles = sphere(6.0, 2)
    vertices = vertices * [elongation, 1.0, 1.0]
    inner = Distance(Surface(*sphere(5.0, 4)))
    cloth = Membrane(vertices, triangles, Material(0.1, 0.48), thickness=1.0, scale=0.4)
    everywhere = sp.eye(len(vertices), format="csr")
    contact = SurfaceContact(everywhere, inner, 100.0, onset=0.01)
    found = solve([cloth, contact], vertices)
    distances = inner.signed(found.x)[0]
    assert np.abs(distances).max() < 0.05
    assert cloth.stretches(found.x).min() > 1.0


def test_contact_planes_push_only_outwards():
    points = sp.eye(len(VERTICES), format="csr")
    lowest = VERTICES[:, 2] < 1e-9
    origins = np.zeros((int(lowest.sum()), 3))
    floor = Contact(points[lowest], origins, np.tile([0.0, 0.0, 1.0], (len(origins), 1)), 50.0, onset=0.01)
    above, below = VERTICES + [0, 0, 0.1], VERTICES - [0, 0, 0.1]
    assert floor.value(above) == 0.0 and not floor.gradient(above).any()
    assert floor.value(below) > 0 and (floor.gradient(below)[lowest, 2] < 0).all()


def test_barrier_stops_interpenetration():
    block, tets = box((1.0, 1.0, 1.0), (3, 3, 3))
    x = block + [0, 0, 0.3]
    table = box_surface((3.0, 3.0, 1.0), (-1.0, -1.0, -1.0))
    from handpipe.mesh.tets.tetrahedra import TetMesh

    faces = TetMesh(block, tets).boundary_faces()[0]
    every = sp.eye(len(block), format="csr")
    pull = Pull(every, np.tile([0.0, 0.0, -0.1], (len(block), 1)))
    barrier = Barrier(every, faces, x, 0.1, 1.0, obstacle=table, pairs=CollidingPairs(self_contact=False))
    held = Attachment(every, x, 1e-3)
    found = solve([Elastic(block, tets, SOFT), pull, barrier, held], x)
    lowest = found.x[:, 2].min()
    assert 0 < lowest < 0.1
    assert barrier.gap(found.x) > 0
    with pytest.raises(InputError, match="intersect"):
        Barrier(every, faces, x - [0, 0, 0.5], 0.1, 1.0, obstacle=table)


def test_failures_say_why_and_partial_results_are_asked_for(caplog):
    elastic, held = Elastic(VERTICES, TETS, SOFT), np.repeat(LEFT | RIGHT, 3)
    hasty = Options(max_iterations=1, name="bar")
    with pytest.raises(ConvergenceError, match="bar did not converge: 1 iterations"):
        solve([elastic], _bend(0.5), fixed=held, options=hasty)
    partial = solve([elastic], _bend(0.5), fixed=held, options=Options(max_iterations=1, allow_partial=True))
    assert not partial.record.converged
    with caplog.at_level(logging.INFO, "handpipe.fem"):
        solve([elastic], _bend(0.1), fixed=held)
    assert "converged" in caplog.text


def test_a_solve_may_end_early_near_the_equilibrium():
    """Newton's method converges quadratically: after a step of 0.05 mm the end is much nearer than that."""
    elastic, held = Elastic(VERTICES, TETS, SOFT), np.repeat(LEFT | RIGHT, 3)
    lengths = []

    def enough(_, step):
        lengths.append(np.linalg.norm(step, axis=1).max())
        return lengths[-1] < 0.05

    exact = solve([elastic], _bend(0.3), fixed=held)
    early = solve([elastic], _bend(0.3), fixed=held, options=Options(enough=enough))
    assert (early.record.converged, early.record.reason) == (True, "near enough")
    assert early.record.iterations == len(lengths) < exact.record.iterations
    apart = np.linalg.norm(early.x - exact.x, axis=1).max()
    assert 1e-6 < apart < 0.2 * lengths[-1]


@pytest.mark.parametrize("single", [False, True])
def test_kept_analyses_change_no_bit(single):
    """Two patterns in turn, as with contact that comes and goes, and a start that is indefinite."""
    options = Options(single=single)
    pull = Attachment(sp.identity(len(VERTICES), format="csr")[RIGHT], VERTICES[RIGHT] * 1.2, 50.0)
    across = sp.csr_matrix(([1.0, -1.0], ([0, 0], [0, len(VERTICES) - 1])), shape=(1, len(VERTICES)))
    tie = Attachment(across, np.zeros((1, 3)), 0.5)
    starts = [VERTICES, VERTICES + 0.1 * np.random.default_rng(0).normal(size=VERTICES.shape)]
    cases = [([pull], starts[0]), ([pull, tie], starts[1]), ([pull], starts[1]), ([pull], starts[0])]
    elastic, kept = Elastic(VERTICES, TETS, SOFT), Analyses()
    for parts, start in cases:
        start = np.where(LEFT[:, None], VERTICES, start)
        given = {"fixed": np.repeat(LEFT, 3), "options": options}
        alone = solve([elastic, *parts], start, **given)
        together = solve([elastic, *parts], start, **given, analyses=kept)
        np.testing.assert_array_equal(together.x, alone.x)
        assert np.abs(alone.x - VERTICES).max() > 0.05
