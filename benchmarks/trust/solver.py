"""Whether the solver's "converged" is true: random scenes, judged by forces computed apart from the solver.

The material's stresses are derivatives of its energy density by complex steps. Springs are judged through
their forces as further unknowns (a mixed system, solved dense). So the rounding of a stiff spring's force
does not hide whether the shape is at rest.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from benchmarks.trust.solver_scenes import ONSET, REACH, Scene, draw
from handpipe.core import Array, ConvergenceError, Metrics
from handpipe.fem.solver import Options, solve

log = logging.getLogger(__name__)

SCENES, UNSUPPORTED = 210, 12
BALANCED = 1e-4  # of the forces on a vertex; the solver is asked for 1e-5
SMALL_STRAIN = 1e-3
STILL = 2e-4  # mm, of the step that would balance; the solver is asked for 1e-4
ROUNDINGS = 30 * float(np.finfo(float).eps)  # of a vertex's forces, which this judge gathers itself
STEP, DIFFERENCE = 1e-30, 1e-6  # of complex steps and of differences


def measure(results: Path) -> Metrics:
    """Scenes solved, those handed on out of balance, and those refused (some have no equilibrium)."""
    verdicts = [judged(draw(i), i) for i in range(SCENES)]
    verdicts += [judged(draw(i, unsupported=True), i) for i in range(UNSUPPORTED)]
    return {
        "solver_scenes": (float(len(verdicts)), "1"),
        "solver_unbalanced": (float(verdicts.count("unbalanced")), "1"),
        "solver_refused": (float(verdicts.count("refused")), "1"),
        "solver_refused_supported": (float(verdicts[:SCENES].count("refused")), "1"),
    }


def judged(scene: Scene, number: int) -> str:
    """ "balanced", "unbalanced" or "refused"; the last two are logged."""
    name = f"{scene.kind} {number}"
    try:
        x = solve(scene.potentials(), scene.body.vertices, options=Options(name=name)).x
    except ConvergenceError as error:
        log.info("refused: %s", error)
        return "refused"
    problem = unbalanced(scene, x)
    if problem:
        log.warning("%s was handed on, but %s", name, problem)
    return "unbalanced" if problem else "balanced"


def unbalanced(scene: Scene, x: Array) -> str:
    """What is wrong with x (n, 3) as an equilibrium of the scene; empty where nothing is."""
    if not scene.supported:
        return "there is no equilibrium"
    gradients, stresses = _rest_gradients(scene), _stresses(scene, x)
    parts = _on_corners(scene, gradients, stresses)
    count = len(x)
    force = np.zeros((count, 3))
    np.add.at(force, scene.body.tets, parts)
    sizes = np.linalg.norm(scene.load, axis=1)
    np.add.at(sizes, scene.body.tets, np.linalg.norm(parts, axis=2))
    plane, plane_stiffness = _planes(scene, x)
    sizes += np.linalg.norm(plane, axis=1)
    allowed = BALANCED * np.maximum(sizes, _least(scene, gradients))
    unbalance = force + plane - scene.load
    tangent = _tangent(scene, x, gradients) + np.diag(plane_stiffness.ravel())
    allowed += ROUNDINGS * (np.abs(tangent) @ np.abs(x).ravel()).reshape(-1, 3).max(axis=1)
    if scene.plate is not None:
        return _on_plate(scene, x, unbalance, allowed)
    step = _mixed_step(scene, x, tangent, unbalance)
    left = np.linalg.norm((tangent @ step).reshape(-1, 3), axis=1) - allowed
    if np.abs(step).max() > STILL:
        return f"the step that balances it is {np.abs(step).max():.2g} mm long"
    if left.max() > 0:
        worst = int(np.argmax(left))
        return f"{left[worst] + allowed[worst]:.2g} mN of {allowed[worst]:.2g} mN are left on vertex {worst}"
    return ""


def _on_plate(scene: Scene, x: Array, unbalance: Array, allowed: Array) -> str:
    """Frictionless contact with a level plate: it pushes upwards what is near, and nothing else.

    Whatever the law of its pressure: it is the force that is missing on vertices near the plate.
    """
    assert scene.plate is not None
    springs = scene.spring_points.T @ (
        scene.spring_stiffness[:, None] * (scene.spring_points @ x - scene.targets)
    )
    reach = np.abs(scene.spring_points @ x).max(axis=1)
    allowed = allowed + ROUNDINGS * (abs(scene.spring_points).T @ (scene.spring_stiffness * reach))
    missing = unbalance + springs
    missing[:, 2] = np.where(x[:, 2] - scene.plate < REACH, np.minimum(missing[:, 2], 0.0), missing[:, 2])
    left = np.linalg.norm(missing, axis=1) - allowed
    if (x[:, 2] <= scene.plate).any():
        return "it penetrates the plate"
    if left.max() > 0:
        return f"the plate does not account for {left.max():.2g} mN on vertex {int(np.argmax(left))}"
    return ""


def _least(scene: Scene, gradients: Array) -> Array:
    """Force (n,) of a small strain, but no more than the largest load on the same body."""
    volumes = _volumes(scene)
    forces = (volumes * scene.young)[:, None] * np.linalg.norm(gradients, axis=2) * SMALL_STRAIN
    least = np.zeros(len(scene.load))
    np.add.at(least, scene.body.tets, forces)
    largest = np.linalg.norm(scene.load, axis=1)
    half = len(largest) // 2
    parts = [slice(0, half), slice(half, None)] if scene.kind == "two" else [slice(None)]
    for part in parts:
        least[part] = np.minimum(least[part], largest[part].max())
    return least


def _volumes(scene: Scene) -> Array:
    corners = scene.body.vertices[scene.body.tets]
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6)


def _rest_gradients(scene: Scene) -> Array:
    """Gradients (m, 4, 3) of the barycentric coordinates, from their interpolation property."""
    corners = scene.body.vertices[scene.body.tets]
    ones = np.ones((*corners.shape[:2], 1))
    return np.linalg.inv(np.concatenate([corners, ones], axis=2))[:, :3].transpose(0, 2, 1)


def _deformations(scene: Scene, x: Array) -> Array:
    return np.einsum("mai,mak->mik", x[scene.body.tets], _rest_gradients(scene))


def _density(scene: Scene, f: Array) -> Array:
    """Energy density (m,) of Smith et al. 2018 in the form of docs/fem.md, at complex F (m, 3, 3)."""
    mu = scene.young / (2 * (1 + scene.poisson))
    lam = scene.young * scene.poisson / ((1 + scene.poisson) * (1 - 2 * scene.poisson))
    m, bulk = 4 / 3 * mu, lam + 5 / 6 * mu
    squares, volume = (f**2).sum(axis=(1, 2)), np.linalg.det(f)
    energy = m / 2 * (squares - 3 - np.log((squares + 1) / 4)) + bulk / 2 * (volume - 1) ** 2
    return np.asarray(energy - 0.75 * m * (volume - 1))


def _first_piola(scene: Scene, f: Array) -> Array:
    """Stresses (m, 3, 3) in kPa."""
    out = np.empty(f.shape)
    for i in range(3):
        for k in range(3):
            moved = f.astype(complex)
            moved[:, i, k] += 1j * STEP
            out[:, i, k] = _density(scene, moved).imag / STEP
    return out


def _stresses(scene: Scene, x: Array) -> Array:
    return _first_piola(scene, _deformations(scene, x))


def _on_corners(scene: Scene, gradients: Array, stresses: Array) -> Array:
    """Gradient of each tet's energy by its corners (m, 4, 3)."""
    return np.einsum("m,mik,mak->mai", _volumes(scene), stresses, gradients)


def _tangent(scene: Scene, x: Array, gradients: Array) -> Array:
    """Dense stiffness (3n, 3n) of the tets, by central differences of the stresses."""
    f, volumes = _deformations(scene, x), _volumes(scene)
    blocks = np.empty((len(f), 4, 3, 4, 3))
    for j in range(3):
        for k in range(3):
            shift = np.zeros((3, 3))
            shift[j, k] = DIFFERENCE
            change = (_first_piola(scene, f + shift) - _first_piola(scene, f - shift)) / (2 * DIFFERENCE)
            part = np.einsum("m,mik,mak,mb->maib", volumes, change, gradients, gradients[:, :, k])
            blocks[:, :, :, :, j] = part if k == 0 else blocks[:, :, :, :, j] + part
    out = np.zeros((x.size, x.size))
    degrees = (3 * scene.body.tets[:, :, None] + np.arange(3)).reshape(len(f), 12)
    np.add.at(out, (degrees[:, :, None], degrees[:, None, :]), blocks.reshape(len(f), 12, 12))
    return 0.5 * (out + out.T)


def _planes(scene: Scene, x: Array) -> tuple[Array, Array]:
    """Gradient (n, 3) and diagonal of the stiffness (n, 3) of the planes' penalty."""
    gradient, stiffness = np.zeros(x.shape), np.zeros(x.shape)
    if not len(scene.heights):
        return gradient, stiffness
    depth = np.maximum(scene.heights - (scene.plane_points @ x)[:, 2], 0.0)
    force = np.where(depth < ONSET, depth**2 / (2 * ONSET), depth - ONSET / 2)
    gradient[:, 2] = -scene.plane_stiffness * (scene.plane_points.T @ force)
    stiffness[:, 2] = scene.plane_stiffness * (scene.plane_points.T @ np.minimum(depth / ONSET, 1.0))
    return gradient, stiffness


def _mixed_step(scene: Scene, x: Array, tangent: Array, unbalance: Array) -> Array:
    """Newton step (3n,) with the springs' forces as unknowns: finite for any stiffness."""
    operator, targets, stiffness = _merged(scene)
    points = np.kron(operator, np.eye(3))
    stretch = (targets - operator @ x).ravel()
    system = np.block([[tangent, points.T], [points, -np.diag(np.repeat(1.0 / stiffness, 3))]])
    found = np.linalg.solve(system, np.concatenate([-unbalance.ravel(), stretch]))
    return np.asarray(found[: x.size])


def _merged(scene: Scene) -> tuple[Array, Array, Array]:
    """Springs as (s, n), (s, 3), (s,), those of one point as one: opposed forces cancel without rounding."""
    operator, number = np.unique(scene.spring_points.toarray(), axis=0, return_inverse=True)
    stiffness = np.bincount(number.ravel(), scene.spring_stiffness).astype(float)
    shares = scene.spring_stiffness / stiffness[number.ravel()]
    targets = np.zeros((len(operator), 3))
    np.add.at(targets, number.ravel(), shares[:, None] * scene.targets)
    return operator, targets, stiffness
