"""Every potential in every state: gradient and Hessian against differences, projection, invariance.

Central differences err as h^2 until rounding takes over, as eps |E| / h. Each derivative is compared over a
ladder of steps: it has to agree to TOLERANCE at the best of them, and while the error is well above rounding
it has to fall as h^2, which a wrong derivative or a one-sided formula cannot.
"""

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box, box_surface, sphere

from handpipe.fem.contact.barrier import Barrier
from handpipe.fem.contact.constraints import Attachment, Contact, Sliding
from handpipe.fem.contact.surface_contact import SurfaceContact
from handpipe.fem.contact.surface_sliding import SurfaceSliding
from handpipe.fem.elements import plasticity
from handpipe.fem.elements.materials import MODELS, Material
from handpipe.fem.potentials.cloth import Membrane
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.inertia import Inertia, mass_matrix
from handpipe.fem.potentials.potential import Potential, Sum
from handpipe.fem.potentials.pull import Pull
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

VERTICES, TETS = box((2.0, 1.0, 1.0), (2, 2, 2))
POINTS, TRIANGLES = sphere(1.0, 1)

EPS = np.finfo(float).eps
STEPS = 10.0 ** -np.arange(2.0, 7.01, 0.5)  # of the state's length
TOLERANCE = 1e-7  # at the best step: (eps)^(2/3) = 4e-11 is ideal, curvature and conditioning cost the rest
ORDER = 1.7  # least order of two that is asked for, fitted over the steps whose error is truncation
TRUNCATION = 1e3  # times rounding: errors above this come from the step
SYMMETRY = 1e-10  # of the largest entry: rounding of sums of 12 x 12 blocks
SEMIDEFINITE = 1e-9  # of the largest eigenvalue: rounding of LAPACK's eigenvalues and of the projection's


@dataclass
class Case:
    """A potential, a state x (n, 3), the length in mm on which it varies, and the motions it cannot feel."""

    potential: Potential
    x: np.ndarray
    length: float = 0.05
    translations: bool = False
    rotations: bool = False
    kinks: bool = False  # third derivatives jump within the ladder of steps: no order of gradients is asked


def _operator(count, vertices, seed=0):
    rng = np.random.default_rng(seed)
    rows = np.repeat(np.arange(count), 4)
    columns = np.concatenate([rng.choice(len(vertices), 4, replace=False) for _ in range(count)])
    weights = rng.dirichlet(np.ones(4), count).ravel()
    return sp.csr_matrix((weights, (rows, columns)), shape=(count, len(vertices)))


def _turn(seed):
    """A random rotation."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


# Deformation gradients U diag(s) V^T of a body by their signed singular values s.
SINGULAR_VALUES = {
    "stretched": (1.3, 0.9, 0.8),
    "coincident-two": (1.2, 1.2, 0.7),
    "coincident-three": (0.8, 0.8, 0.8),
    "near-inverted": (2.0, 1.0, 5e-4),  # det F = 1e-3
    "inverted": (1.2, 0.9, -0.7),
    "coincident-inverted": (0.9, 0.7, -0.7),
    "near-degenerate": (1.0, 1e-4, 1e-4),
    "flattened": (1.1, 0.9, 0.0),
    "rank-one": (1.1, 0.0, 0.0),
    "rank-zero": (0.0, 0.0, 0.0),
}


def _homogeneous(model, values):
    """All tets under one deformation gradient without plastic strain: F is exactly as named."""
    gradient = _turn(1) @ np.diag(values) @ _turn(2)
    body = Elastic(VERTICES, TETS, Material(6.0, 0.48, model))
    return Case(body, VERTICES @ gradient.T, translations=True, rotations=True)


def _strained(model, scatter):
    """Another deformation in each tet, plastic strains, weights; inverted tets where scatter is large."""
    rng = np.random.default_rng(1)
    strains = plasticity.exp(0.2 * rng.normal(size=(len(TETS), 6)))
    body = Elastic(VERTICES, TETS, Material(6.0, 0.48, model), strains, rng.uniform(0.2, 1.0, len(TETS)))
    x = VERTICES + scatter * rng.normal(size=VERTICES.shape)
    assert (np.linalg.det(body.deformation_gradients(x)).min() < 0) == (scatter > 0.2)
    return Case(body, x, translations=True, rotations=True)


def _crushing(values, steepest):
    """The barrier on volume, under plastic strains that leave F Fp^-1 as named."""
    case = _homogeneous("stable-neo-hookean", values)
    strains = plasticity.exp(0.1 * np.random.default_rng(2).normal(size=(1, 6)))
    fp = plasticity.to_matrices(strains)[0]
    body = case.potential.with_strains(np.repeat(strains, len(TETS), axis=0))
    x = VERTICES @ fp @ np.linalg.lstsq(VERTICES, case.x, rcond=None)[0]
    return Case(body.crushing(steepest), x, 1e-3, translations=True, rotations=True)


def _crushing_of_some():
    """Tets above the onset and inverted ones."""
    case = _strained("stable-neo-hookean", 0.4)
    ratios = case.potential.volume_ratios(case.x)
    assert ratios.min() < 0 and ratios.max() > 0.5
    return Case(case.potential.crushing(0.1), case.x, 1e-3, translations=True, rotations=True, kinks=True)


def least_dihedral(tet):
    """Smallest angle in degrees between two faces of a tet (4, 3)."""
    centre = tet.mean(axis=0)
    normals = []
    for a, b, c in ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)):
        n = np.cross(tet[b] - tet[a], tet[c] - tet[a])
        n *= np.sign(n @ (tet[a] - centre)) / np.linalg.norm(n)
        normals.append(n)
    cosines = [-normals[i] @ normals[j] for i in range(4) for j in range(i)]
    return np.degrees(np.arccos(np.clip(cosines, -1, 1))).min()


def _sliver(model):
    """Four vertices almost on a circle, moved by about the sliver's thickness."""
    rest = np.array([[1, 0, 0], [0, 1, 0.01], [-1, 0, 0], [0, -1, 0.01]]) @ _turn(3).T
    tets = np.array([[0, 1, 2, 3]])
    if np.linalg.det(rest[1:] - rest[0]) < 0:
        tets = tets[:, [0, 2, 1, 3]]
    assert least_dihedral(rest) < 1.0
    x = rest + 0.004 * np.random.default_rng(4).normal(size=rest.shape)
    return Case(Elastic(rest, tets, Material(6.0, 0.48, model)), x, 1e-3, translations=True, rotations=True)


def _planes(kind):
    operator = _operator(12, VERTICES)
    rng = np.random.default_rng(2)
    origins = operator @ VERTICES + 0.1 * rng.normal(size=(12, 3))
    potential = kind(operator, origins, rng.normal(size=(12, 3)), rng.uniform(1, 5, 12))
    kinked = kind is Contact
    return Case(potential, VERTICES, 0.5 if kind is Sliding else 0.01, kinks=kinked)


def _beside(feature, inside):
    """Points closest to a feature of a box: outside of a convex one, inside of a hollow one."""
    rng = np.random.default_rng(3)
    side, shift = rng.uniform(0.2, 0.8, (9, 3)), rng.uniform(0.03, 0.08, (9, 3))
    points = {
        "face": np.column_stack([side[:, :2], 1 + shift[:, 2]]),
        "edge": np.column_stack([side[:, 0], 1 + shift[:, 1:]]),
        "vertex": 1 + shift,
    }[feature]
    vertices, triangles = box_surface((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    turned = triangles[:, ::-1] if inside else triangles  # inside out, the outside of the box is the inside
    return points, Distance(Surface(vertices, turned))


def _surface_contact(feature, inside=False):
    points, distance = _beside(feature, inside)
    every = sp.eye(len(points), format="csr")
    return Case(SurfaceContact(every, distance, 3.0, thickness=0.2), points, 0.02)


def _surface_sliding(feature, inside=False):
    points, distance = _beside(feature, inside)
    every = sp.eye(len(points), format="csr")
    return Case(SurfaceSliding(every, distance, np.arange(1.0, 10.0)), points, 0.02)


def _inner_contact():
    """Embedded points inside of the box, pressed through its lowest face."""
    surface = Surface(*box_surface((4.0, 4.0, 2.0), (-1.0, -1.0, -1.7)))
    lowest = sp.eye(len(VERTICES), format="csr")[VERTICES[:, 2] < 0.1]
    x = VERTICES + 0.02 * np.random.default_rng(3).normal(size=VERTICES.shape)
    return Case(SurfaceContact(lowest, Distance(surface), 3.0, thickness=0.1), x, 0.01)


def _barrier_on_obstacle():
    obstacle = box_surface((4.0, 4.0, 1.0), (-2.0, -2.0, -2.05))
    x = POINTS + 0.003 * np.random.default_rng(4).normal(size=POINTS.shape)
    identity = sp.eye(len(POINTS), format="csr")
    return Case(Barrier(identity, TRIANGLES, POINTS, 0.15, 10.0, obstacle=obstacle), x, 1e-3, kinks=True)


def _barrier_on_itself():
    """Two spheres, embedded in a body, in one surface."""
    skin = np.concatenate([0.2 * POINTS + [0.5, 0.5, 0.5], 0.2 * POINTS @ _turn(5).T + [0.92, 0.52, 0.5]])
    triangles = np.concatenate([TRIANGLES, TRIANGLES + len(POINTS)])
    rng = np.random.default_rng(6)
    corners = np.stack([rng.choice(len(VERTICES), 4, replace=False) for _ in skin])
    system = np.concatenate([VERTICES[corners].transpose(0, 2, 1), np.ones((len(skin), 1, 4))], axis=1)
    solvable = np.abs(np.linalg.det(system)) > 0.05
    while not solvable.all():
        corners[~solvable] = [rng.choice(len(VERTICES), 4, replace=False) for _ in range((~solvable).sum())]
        system = np.concatenate([VERTICES[corners].transpose(0, 2, 1), np.ones((len(skin), 1, 4))], axis=1)
        solvable = np.abs(np.linalg.det(system)) > 0.05
    weights = np.linalg.solve(system, np.column_stack([skin, np.ones(len(skin))])[..., None])[..., 0]
    rows = np.repeat(np.arange(len(skin)), 4)
    operator = sp.csr_matrix((weights.ravel(), (rows, corners.ravel())), shape=(len(skin), len(VERTICES)))
    np.testing.assert_allclose(operator @ VERTICES, skin, atol=1e-12)
    barrier = Barrier(operator, triangles, VERTICES, 0.06, 10.0)
    return Case(barrier, VERTICES, 1e-4, translations=True, rotations=True, kinks=True)


def _cloth(kind):
    rough = POINTS + 0.1 * np.random.default_rng(5).normal(size=POINTS.shape)
    potential = {
        "membrane-tension": lambda: Membrane(POINTS, TRIANGLES, Material(0.1, 0.48), 0.5, 0.4),
        "membrane-slack": lambda: Membrane(POINTS, TRIANGLES, Material(0.1, 0.48), 0.5, 1.5),
    }[kind]()
    return Case(potential, rough, translations=True, rotations=True)


def _inertia():
    rng = np.random.default_rng(8)
    mass = mass_matrix(VERTICES, TETS, 1e-6)
    return Case(Inertia(mass, VERTICES, rng.normal(size=VERTICES.shape), 0.01), VERTICES)


def _sum():
    parts = [_strained("stvk", 0.05), _planes(Sliding), _inertia()]
    return Case(Sum([part.potential for part in parts]), VERTICES)


def _cases():
    targets = np.random.default_rng(0).normal(size=(5, 3))
    for model in MODELS:
        for state, values in SINGULAR_VALUES.items():
            yield f"{model}-{state}", lambda model=model, values=values: _homogeneous(model, values)
        yield f"{model}-strained", lambda model=model: _strained(model, 0.05)
        yield f"{model}-scrambled", lambda model=model: _strained(model, 0.4)
        yield f"{model}-sliver", lambda model=model: _sliver(model)
    for state, values in (("crushed", (1.2, 0.9, 0.05)), *SINGULAR_VALUES.items()):
        if np.prod(values) < 0.1 and not state.startswith("rank"):  # elsewhere all derivatives vanish
            yield f"crushing-{state}", lambda values=values: _crushing(values, 0.1)
    yield "crushing-steep", lambda: _crushing((1.1, 0.9, 0.03), 1e-3)
    yield "crushing-of-some", _crushing_of_some
    spring = Attachment(_operator(5, VERTICES), targets, np.arange(1.0, 6.0))
    yield "attachment", lambda: Case(spring, VERTICES, 0.5)
    yield "sliding", lambda: _planes(Sliding)
    yield "contact", lambda: _planes(Contact)
    for feature in ("face", "edge", "vertex"):
        yield f"surface-contact-{feature}", lambda feature=feature: _surface_contact(feature)
        yield f"surface-contact-hollow-{feature}", lambda feature=feature: _surface_contact(feature, True)
        yield f"surface-sliding-{feature}", lambda feature=feature: _surface_sliding(feature)
        yield f"surface-sliding-hollow-{feature}", lambda feature=feature: _surface_sliding(feature, True)
    yield "surface-contact-inside", _inner_contact
    yield "pull", lambda: Case(Pull(_operator(5, VERTICES), targets), VERTICES, 0.5)
    yield "inertia", _inertia
    yield "barrier-obstacle", _barrier_on_obstacle
    yield "barrier-self", _barrier_on_itself
    for kind in ("membrane-tension", "membrane-slack"):
        yield kind, lambda kind=kind: _cloth(kind)
    yield "sum", _sum


CASES = dict(_cases())


def _assert_agrees(errors, steps, rounding, scale, order=True):
    """Errors (s,) of differences over steps (s,): small at the best, and of second order above rounding."""
    allowed = TOLERANCE * scale + rounding.min()
    assert errors.min() <= allowed, f"best error {errors.min():.2e}, allowed {allowed:.2e}"
    truncated = errors > TRUNCATION * rounding
    if order and truncated.sum() >= 3:
        slope = np.polyfit(np.log(steps[truncated]), np.log(errors[truncated]), 1)[0]
        assert slope > ORDER, f"order {slope:.2f}"


@pytest.mark.parametrize("name", CASES)
def test_derivatives_agree_with_differences(name):
    case = CASES[name]()
    potential, x, steps = case.potential, case.x, case.length * STEPS
    direction = np.random.default_rng(7).normal(size=x.shape)
    direction /= np.linalg.norm(direction)
    ahead, behind = ([x + sign * h * direction for h in steps] for sign in (1, -1))

    gradient, hessian = potential.gradient(x), potential.hessian(x)
    values = np.array([[potential.value(a), potential.value(b)] for a, b in zip(ahead, behind, strict=True)])
    slopes = (values[:, 0] - values[:, 1]) / (2 * steps)
    # Rounding of a value: of the sums that it comes from, at least of forces times coordinates.
    size = max(np.abs(values).max(), np.abs(gradient).max() * np.abs(x).max())
    product = hessian @ direction.ravel()
    # A collapsed body has energy and neither force nor stiffness.
    least = 1e-3 * np.abs(values).max() / np.ptp(VERTICES)
    scale = max(np.linalg.norm(gradient), np.linalg.norm(product) * case.length, least)
    assert scale > 0
    errors = np.abs(slopes - np.vdot(gradient, direction))
    _assert_agrees(errors, steps, 100 * EPS * size / steps, scale)

    ladder = zip(ahead, behind, steps, strict=True)
    turned = [(potential.gradient(a) - potential.gradient(b)).ravel() / (2 * h) for a, b, h in ladder]
    errors = np.array([np.linalg.norm(t - product) for t in turned])
    largest = max(np.linalg.norm(gradient), sp.linalg.norm(hessian) * np.abs(x).max())
    scale = max(np.linalg.norm(product), 1e-3 * sp.linalg.norm(hessian), least / np.ptp(VERTICES))
    _assert_agrees(errors, steps, 10 * EPS * largest / steps, scale, order=not case.kinks)


@pytest.mark.parametrize("name", CASES)
def test_hessian_is_symmetric_and_its_projection_semidefinite(name):
    case = CASES[name]()
    plain, projected = case.potential.hessian(case.x), case.potential.hessian(case.x, project=True)
    assert plain.has_sorted_indices
    for matrix in (plain, projected):
        assert abs(matrix - matrix.T).max() <= SYMMETRY * abs(matrix).max()
    values = np.linalg.eigvalsh(projected.toarray())
    assert values[0] >= -SEMIDEFINITE * values[-1]


@pytest.mark.parametrize("name", [n for n in CASES if CASES[n]().translations])
def test_moving_everything_costs_nothing(name):
    case = CASES[name]()
    potential, x, shift = case.potential, case.x, np.array([0.3, -0.2, 0.5])
    value, gradient = potential.value(x), potential.gradient(x)
    size = np.abs(gradient).sum() * np.abs(x).max() + abs(value)
    assert potential.value(x + shift) == pytest.approx(value, abs=1e-10 * size)
    np.testing.assert_allclose(gradient.sum(axis=0), 0.0, atol=1e-11 * np.abs(gradient).sum() + 1e-13)
    if case.rotations:
        turn = _turn(9)
        assert potential.value(x @ turn.T) == pytest.approx(value, abs=1e-10 * size)
        atol = 1e-9 * np.abs(gradient).max() + 1e-13
        np.testing.assert_allclose(potential.gradient(x @ turn.T), gradient @ turn.T, atol=atol)
        np.testing.assert_allclose(np.cross(x, gradient).sum(axis=0), 0.0, atol=1e-10 * size + 1e-13)


@pytest.mark.parametrize("model", MODELS)
def test_projection_changes_nothing_at_rest(model):
    elastic = Elastic(VERTICES, TETS, Material(6.0, 0.48, model))
    difference = elastic.hessian(VERTICES, project=True) - elastic.hessian(VERTICES)
    assert abs(difference).max() < 1e-10 * abs(elastic.hessian(VERTICES)).max()
