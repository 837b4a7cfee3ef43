"""Barrier contact in hard scenes: no intersection by an independent test, forces in balance, known gaps."""

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse as sp
from tests.fem.bodies import box, box_surface, cuts, sphere

from handpipe.core.errors import ConvergenceError, InputError
from handpipe.fem.contact.barrier import Barrier, CollidingPairs, barrier_stiffness, pressure_ratio
from handpipe.fem.contact.constraints import Attachment
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.solver.equilibrium import Options, Steps, continuation, solve
from handpipe.fem.solver.prescribed_motion import approach
from handpipe.mesh.tets.tetrahedra import TetMesh

NEAR = 0.05  # mm, activation distance
SOFT = Material(6.0, 0.45)


def _body(size, cells, material=SOFT):
    vertices, tets = box(size, cells)
    faces = TetMesh(vertices, tets).boundary_faces()[0]
    return Elastic(vertices, tets, material), faces, sp.eye(len(vertices), format="csr")


def _two(a, b):
    """Two obstacles as one."""
    return np.concatenate([a[0], b[0]]), np.concatenate([a[1], b[1] + len(a[0])])


def _uniaxial_force(body, stretch):
    """Force on the lowest face of a box between frictionless plates, whose stress is homogeneous."""
    x = body.vertices
    low, side = x[:, 2] == 0, x[:, 0] == 0
    wide = scipy.optimize.brentq(lambda b: body.gradient(x * [b, b, stretch])[side, 0].sum(), 0.9, 3.0)
    return body.gradient(x * [wide, wide, stretch])[low, 2].sum()


def _is_sound(found, barrier, body):
    """What every scene has to satisfy."""
    assert found.record.converged
    assert not barrier.intersects(found.x)
    assert barrier.gap(found.x) > 0
    assert np.linalg.det(body.deformation_gradients(found.x)).min() > 0


def test_gap_of_two_parallel_faces_is_where_the_pressure_says():
    body, faces, every = _body((2.0, 2.0, 2.0), (3, 3, 3), Material(6.0, 0.0))
    x = body.vertices
    plates, squares = _two(
        box_surface((6.0, 6.0, 1.0), (-2.0, -2.0, -1.04)), box_surface((6.0, 6.0, 1.0), (-2.0, -2.0, 2.04))
    )
    barrier = Barrier(every, faces, x, NEAR, 6.0, obstacle=(plates, squares))
    closed = plates + np.where(plates[:, 2:] < 1, 0.2, -0.2) * [0, 0, 1]
    hold = Attachment(every, x, 1e-6)
    found, barrier = approach([body, hold], barrier, x, closed)
    _is_sound(found, barrier, body)
    reactions = [barrier.obstacle_forces(found.x)[plates[:, 2] < 1], barrier.obstacle_forces(found.x)[8:]]
    np.testing.assert_allclose(reactions[0].sum(axis=0), -reactions[1].sum(axis=0), atol=1e-3)
    shares = np.where(x[:, :2] % 2.0 == 0, 0.5, 1.0).prod(axis=1)  # of a face's area, by its vertices
    faced = [np.abs(x[:, 2] - level) < 1e-9 for level in (0.0, 2.0)]
    levels = [np.average(found.x[face, 2], weights=shares[face]) for face in faced]
    force = _uniaxial_force(body, np.diff(levels)[0] / 2.0)
    pressed = -reactions[0][:, 2].sum()
    assert pressed == pytest.approx(force, rel=0.01)
    ratio = pressed / (6.0 * 4.0 * pressure_ratio((levels[0] + 0.04 - 0.2) / NEAR))
    assert 1 / 5 < ratio < 4


def test_block_squeezed_between_closing_plates_to_two_fifths_of_its_height():
    body, faces, every = _body((2.0, 2.0, 2.0), (4, 4, 4))
    x = body.vertices
    plates, squares = _two(
        box_surface((6.0, 6.0, 1.0), (-2.0, -2.0, -1.03)), box_surface((6.0, 6.0, 1.0), (-2.0, -2.0, 2.03))
    )
    stiffness = barrier_stiffness([body], every, faces, x)
    barrier = Barrier(every, faces, x, NEAR, stiffness, obstacle=(plates, squares))
    closed = plates + np.where(plates[:, 2:] < 1, 0.63, -0.63) * [0, 0, 1]
    springs = Attachment(every, x, 1e-4)
    found, barrier = approach([body, springs], barrier, x, closed)
    _is_sound(found, barrier, body)
    assert np.ptp(found.x[:, 2]) < 0.4 * 2.0
    surfaces = np.concatenate([found.x, barrier.obstacle]), np.concatenate([faces, squares + len(x)])
    assert not cuts(*surfaces)
    balance = barrier.obstacle_forces(found.x).sum(axis=0) + springs.gradient(found.x).sum(axis=0)
    np.testing.assert_allclose(balance, 0.0, atol=len(x) * found.record.residuals[-1])
    force = _uniaxial_force(body, np.ptp(found.x[:, 2]) / 2.0)
    assert -barrier.obstacle_forces(found.x)[:8, 2].sum() == pytest.approx(force, rel=0.05)


def test_slab_is_folded_onto_itself():
    length, thick, gap = 8.0, 0.5, 0.03
    body, faces, every = _body((length, 1.0, thick), (24, 3, 2))
    x = body.vertices
    left, right = x[:, 0] < 1e-9, x[:, 0] > length - 1e-9
    barrier = Barrier(every, faces, x, NEAR, barrier_stiffness([body], every, faces, x))

    def place(t):
        """The right end turns by half a circle on an arc, then comes down onto the left end."""
        angle, down = max(min(t / 0.7, 1.0) * np.pi, 1e-9), max(t - 0.7, 0.0) / 0.3
        c, s, radius = np.cos(angle), np.sin(angle), length / angle
        end = (1 - down) * np.array([radius * s, 0, thick / 2 + radius * (1 - c)])
        end += down * np.array([0.0, 0.0, 1.5 * thick + gap])
        out = x.copy()
        out[right] = (x[right] - [length, 0, thick / 2]) @ [[c, 0, s], [0, 1, 0], [-s, 0, c]] + end
        return out

    held = np.repeat(left | right, 3)
    found = continuation(lambda t: [body, barrier], x, fixed=held, prescribed=place, steps=Steps(first=0.1))
    _is_sound(found, barrier, body)
    assert barrier.gap(found.x) < gap + 1e-9 and barrier.value(found.x) > 0
    assert not cuts(found.x, faces)
    forces = barrier.gradient(found.x)
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-9 * np.abs(forces).sum())
    free = ~(left | right)
    assert np.abs((forces + body.gradient(found.x))[free]).max() < 1e-4 * np.abs(forces).max()


def _sandwich():
    """A thin stiff sheet between two blocks, in one set of positions."""
    parts = [
        (box((3.0, 3.0, 0.1), (6, 6, 1)), [0.0, 0.0, 0.0]),
        (box((3.0, 3.0, 1.0), (5, 5, 2)), [0.0, 0.0, -1.03]),
        (box((2.0, 2.0, 1.0), (4, 4, 2)), [0.45, 0.55, 0.13]),
    ]
    starts = np.cumsum([0, *(len(part[0][0]) for part in parts)])
    vertices = np.concatenate([part[0] + low for part, low in parts])
    tets = np.concatenate([part[1] + start for (part, _), start in zip(parts, starts, strict=False)])
    young = np.where(tets[:, 0] < starts[1], 60.0, 6.0)
    return vertices, tets, Elastic(vertices, tets, Material(young, 0.45)), starts


def test_thin_sheet_carries_contact_on_both_sides():
    vertices, tets, body, starts = _sandwich()
    faces = TetMesh(vertices, tets).boundary_faces()[0]
    every = sp.eye(len(vertices), format="csr")
    barrier = Barrier(every, faces, vertices, NEAR, 6.0)
    low, top = vertices[:, 2] < -1.02, vertices[:, 2] > 1.12
    target = vertices - 0.4 * top[:, None] * [0, 0, 1]
    hold = Attachment(every[: starts[1]], vertices[: starts[1]], 1e-2)
    fixed = np.repeat(low | top, 3)
    found, barrier = approach([body, hold], barrier, vertices, barrier.obstacle, fixed=fixed, target=target)
    _is_sound(found, barrier, body)
    assert not cuts(found.x, faces)
    np.testing.assert_allclose(found.x[top], target[top], atol=1e-12)
    press = barrier.gradient(found.x)
    below, above = press[starts[1] : starts[2]].sum(axis=0), press[starts[2] :].sum(axis=0)
    held = hold.gradient(found.x).sum(axis=0)
    assert above[2] < -1.0  # the gradient is minus the force: the upper block is pushed up
    np.testing.assert_allclose(below + above, held, atol=1e-3)
    reaction = body.gradient(found.x)[top].sum(axis=0) + press[top].sum(axis=0)
    np.testing.assert_allclose(reaction, above, atol=1e-3)


@pytest.mark.parametrize("subdivisions", [1, 3])  # coarser and finer than the tets
def test_closing_bones_pinch_an_embedded_surface(subdivisions):
    from handpipe.mesh.tets.embedding import Embedding

    body, _, every = _body((4.0, 4.0, 2.0), (8, 8, 4), Material(6.0, 0.48))
    skin, triangles = sphere(0.99, subdivisions)
    skin = skin * [1.9, 1.9, 1.0] + [2.0, 2.0, 1.0]
    operator = Embedding.embed(skin, TetMesh(body.vertices, body.tets)).matrix(len(body.vertices))
    bone, sides = sphere(1.5, 2)
    bones, squares = _two((bone + [2, 2, -1.6], sides), (bone + [2.4, 2.2, 3.6], sides))
    barrier = Barrier(operator, triangles, body.vertices, NEAR, 6.0, obstacle=(bones, squares))
    x, hold = body.vertices, Attachment(every, body.vertices, 1e-2)
    upper = bones[:, 2:] > 1
    for closed in (0.3, 0.6):
        place = bones + closed * np.where(upper, -1.0, 1.0) * [0, 0, 1]
        found, barrier = approach([body, hold], barrier, x, place, options=Options(name="pinch"))
        x = found.x
    _is_sound(found, barrier, body)
    surface = operator @ x
    assert not cuts(np.concatenate([surface, place]), np.concatenate([triangles, squares + len(surface)]))
    thickness = np.ptp(surface[np.linalg.norm(skin[:, :2] - 2, axis=1) < 0.5, 2])
    assert thickness < 1.75  # of 1.98
    forces = barrier.obstacle_forces(x)
    assert forces[upper[:, 0], 2].sum() > 1.0 and forces[~upper[:, 0], 2].sum() < -1.0
    np.testing.assert_allclose(forces.sum(axis=0), -hold.gradient(x).sum(axis=0), atol=1e-3)


def test_one_body_is_pressed_into_itself():
    """A hook whose finger is bent onto its palm: one mesh, one surface."""
    vertices, tets = box((4.0, 1.0, 2.0), (12, 3, 6))
    centres = vertices[tets].mean(axis=1)
    slot = (centres[:, 0] > 1.0) & (np.abs(centres[:, 2] - 1.0) < 0.34)
    used, tets = np.unique(tets[~slot], return_inverse=True)
    vertices, tets = vertices[used], tets.reshape(-1, 4)
    body = Elastic(vertices, tets, SOFT)
    faces = TetMesh(vertices, tets).boundary_faces()[0]
    every = sp.eye(len(vertices), format="csr")
    barrier = Barrier(every, faces, vertices, NEAR, barrier_stiffness([body], every, faces, vertices))
    palm, tip = vertices[:, 2] < 1e-9, (vertices[:, 0] > 3.99) & (vertices[:, 2] > 1.99)
    target = vertices - 0.9 * tip[:, None] * [0, 0, 1]
    fixed = np.repeat(palm | tip, 3)
    found, barrier = approach([body], barrier, vertices, barrier.obstacle, fixed=fixed, target=target)
    _is_sound(found, barrier, body)
    assert barrier.gap(found.x) < NEAR
    assert not cuts(found.x, faces)
    lone = np.where(tip[:, None], target, vertices)
    assert cuts(solve([body], lone, fixed=fixed).x, faces)  # without the barrier it would go through


def test_obstacle_that_cannot_pass_says_so():
    body, faces, every = _body((1.0, 1.0, 1.0), (2, 2, 2))
    x = body.vertices
    table, sides = box_surface((3.0, 3.0, 1.0), (-1.0, -1.0, -1.03))
    barrier = Barrier(every, faces, x, NEAR, 6.0, obstacle=(table, sides))
    fixed = np.ones(x.size, dtype=bool)
    with pytest.raises(ConvergenceError, match="cannot come nearer"):
        approach([body], barrier, x, table + [0, 0, 0.5], fixed=fixed)


def test_nothing_is_hidden_from_a_solver_that_steps_blindly():
    body, faces, every = _body((1.0, 1.0, 1.0), (2, 2, 2))
    x = body.vertices
    table, sides = box_surface((3.0, 3.0, 1.0), (-1.0, -1.0, -1.03))
    barrier = Barrier(every, faces, x, NEAR, 6.0, obstacle=(table, sides))
    down = np.tile([0.0, 0.0, -0.5], (len(x), 1))
    fraction = barrier.max_step(x, down)
    assert 0.9 * 0.06 * 0.8 < fraction < 0.06
    assert np.isfinite(barrier.value(x + fraction * down))
    assert barrier.value(x + down) == np.inf and barrier.intersects(x + down)
    assert barrier.with_obstacle(table + [0, 0, 0.5]).value(x) == np.inf
    with pytest.raises(InputError, match="intersect"):
        Barrier(every, faces, x + down, NEAR, 6.0, obstacle=(table, sides))


def test_candidates_of_a_step_find_what_a_new_search_finds():
    skin, triangles = sphere(1.0, 2)
    table, sides = box_surface((4.0, 4.0, 1.0), (-2.0, -2.0, -2.2))
    every = sp.eye(len(skin), format="csr")
    barrier = Barrier(every, triangles, skin, 0.15, 6.0, obstacle=(table, sides))
    fresh = Barrier(every, triangles, skin, 0.15, 6.0, obstacle=(table, sides))
    rng = np.random.default_rng(0)
    step = np.tile([0.1, 0.0, -0.4], (len(skin), 1)) + 0.02 * rng.normal(size=skin.shape)
    fraction = barrier.max_step(skin, step)
    assert 0 < fraction < 1
    for share in (0.5, 0.9, 1.0):
        x = skin + share * fraction * step
        assert barrier.value(x) == pytest.approx(fresh.value(x), rel=1e-12)
        np.testing.assert_allclose(barrier.gradient(x), fresh.gradient(x), atol=1e-12)
    assert fresh.value(x) > 0


def test_a_surface_does_not_feel_its_own_neighbours():
    skin, triangles = sphere(1.0, 3)  # edges of about 0.15
    every = sp.eye(len(skin), format="csr")
    near = Barrier(every, triangles, skin, 0.2, 6.0)
    assert near.value(skin) == 0.0 and not near.gradient(skin).any()
    flat = skin * [1.0, 1.0, 0.05]  # opposite sides are no neighbours
    assert near.value(flat) > 0


def test_an_edge_that_comes_in_among_neighbours_does_not_count_as_a_cut():
    """The end of one triangle goes through the side of another; only their far corners may collide."""
    a, b, c, d, e = [0.5, 1.0, 0.0], [0.5, 0.3, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, -2.0, 0.0]
    rest = np.array([a, b, c, d, e, [1.0, 1.0, 0.0], [-0.5, 0.6, 0.0]])
    triangles = np.array([[2, 4, 3], [0, 1, 5], [1, 2, 6]])
    x = rest + 0.0
    x[0], x[1], x[5] = [0.5, -0.5, 0.4], [0.5, -0.5, -0.4], [1.0, 1.0, 0.4]
    every = sp.eye(len(rest), format="csr")
    assert cuts(x, triangles)
    with pytest.raises(InputError, match="intersect"):  # a shorter range: no neighbours
        Barrier(every, triangles, x, 0.1, 6.0, pairs=CollidingPairs(rest=rest))
    barrier = Barrier(every, triangles, rest, 0.5, 6.0)
    path = [rest + share * (x - rest) for share in np.linspace(0.0, 1.0, 41)]
    assert all(np.isfinite(barrier.value(p)) for p in path) and not barrier.intersects(x)
    assert barrier.max_step(rest, x - rest) == 1.0  # nothing stops it on the way
    x[0] = [0.5, -1.5, 0.4]
    x[1] = [0.5, -1.5, -0.4]  # straight below, through the far side: that is stopped, and is a cut
    far = rest + 0.0
    far[0], far[1], far[5] = [1.5, -2.5, 0.4], [1.5, -2.5, -0.4], [2.0, -2.5, 0.4]
    assert barrier.max_step(far, x - far) < 1.0


def test_stiffness_is_of_the_size_of_youngs_modulus():
    for young in (0.5, 60.0):
        body, faces, every = _body((3.0, 2.0, 1.0), (4, 3, 2), Material(young, 0.48))
        assert young / 2 < barrier_stiffness([body], every, faces, body.vertices) < 2 * young


def test_the_pattern_of_the_hessian_lasts_over_many_states():
    skin, triangles = sphere(1.0, 2)
    table, sides = box_surface((4.0, 4.0, 1.0), (-2.0, -2.0, -2.05))
    every = sp.eye(len(skin), format="csr")
    barrier = Barrier(every, triangles, skin, 0.1, 6.0, obstacle=(table, sides))
    rng = np.random.default_rng(0)
    patterns = []
    for _ in range(6):
        x = skin + 0.002 * rng.normal(size=skin.shape)
        plain, projected = barrier.hessian(x), barrier.hessian(x, True)
        assert np.shares_memory(plain.indices, projected.indices)
        patterns.append(plain.indices)
    assert np.shares_memory(patterns[-1], patterns[-2])
    assert np.shares_memory(patterns[-2], patterns[-3])


def test_a_barrier_that_reaches_farther_pushes_from_there_on():
    body, faces, every = _body((1.0, 1.0, 1.0), (2, 2, 2))
    x = body.vertices
    table, sides = box_surface((3.0, 3.0, 1.0), (-1.0, -1.0, -1.0 - 2 * NEAR))
    near = Barrier(every, faces, x, NEAR, 6.0, obstacle=(table, sides))
    far = near.reaching(4 * NEAR)
    assert near.value(x) == 0.0
    pressure = 6.0 * pressure_ratio(0.5)
    assert 0.2 * pressure < -far.gradient(x)[:, 2].sum() < 4.0 * pressure  # on an area of 1 mm^2
    assert np.isinf(near.gap(x)) and np.isclose(far.gap(x), 2 * NEAR)


def test_the_same_scene_gives_the_same_bits():
    (x, tets), (lid, lid_tets) = box((8.0, 8.0, 1.0), (16, 16, 1)), box((8.0, 8.0, 1.0), (15, 15, 1))
    faces, above = (TetMesh(*body).boundary_faces()[0] for body in ((x, tets), (lid, lid_tets)))
    x = x + np.random.default_rng(0).normal(0.0, 1e-3, x.shape)
    every = sp.eye(len(x), format="csr")
    found = set()
    for _ in range(6):
        barrier = Barrier(every, faces, x, NEAR, 6.0, obstacle=(lid + [0.1, 0.2, 1.02], above))
        hessian = sp.csr_matrix(barrier.hessian(x))
        hessian.sort_indices()
        found.add((barrier.value(x), barrier.gradient(x).tobytes(), hessian.data.tobytes()))
    assert len(found) == 1
    assert next(iter(found))[0] > 0
