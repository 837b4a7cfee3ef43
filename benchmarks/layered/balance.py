"""Balance of forces in a simulated layer, computed apart from its solver.

Stresses are complex-step derivatives of the energy density, springs are computed from their data. On vertices
that contact or sliding may push, nothing is judged: whatever the law of contact, no other vertex feels it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, Frame, IntArray, Shapes
from handpipe.fem.contact import Attachment, Contact, Sliding, SurfaceSliding
from handpipe.fem.potentials import Elastic
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import mass_lumped
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.tissue import Tissue
from handpipe.tissues.muscles import MuscleLayer

SMALL_STRAIN = 1e-3  # whose forces are the least by which a vertex is measured
CRUSHED = 0.1  # det F below which a barrier takes the material's place
NEAR, TOUCH = 1.5, 0.2  # mm from neighbours and from bodies within which contact may push
STEP = 1e-30  # of complex steps


@dataclass(frozen=True)
class Springs:
    """Springs from points (k, n) @ x to targets (k, 3) in mm, of stiffness (k,) in mN/mm."""

    points: sparse.csr_matrix
    targets: Array
    stiffness: Array


@dataclass(frozen=True)
class Body:
    """Tets in mm with moduli (m,) in kPa, plastic strains (m, 3, 3), and springs.

    young includes the share of each tet that is tissue; pushed: vertices (n,) that contact may push.
    """

    rest: Array
    tets: IntArray
    young: Array
    poisson: float
    strains: Array
    springs: Sequence[Springs]
    pushed: BoolArray


@dataclass(frozen=True)
class Unbalance:
    """Largest force left on a vertex as a share of the forces on it, and the share of vertices judged."""

    largest: float
    judged: float


def unbalance(body: Body, x: Array) -> Unbalance:
    """How far x (n, 3) is from equilibrium where nothing but tets and springs acts."""
    corners, inverse = body.rest[body.tets], np.linalg.inv(body.strains)
    ones = np.ones((*corners.shape[:2], 1))
    barycentric = np.linalg.inv(np.concatenate([corners, ones], axis=2))[:, :3].transpose(0, 2, 1)
    gradients = barycentric @ inverse  # of x by the plastically strained rest shape
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6 * np.linalg.det(body.strains)
    elastic = np.einsum("mai,mak->mik", x[body.tets], gradients)
    stress = first_piola(elastic, body.young, body.poisson)
    parts = np.einsum("m,mik,mak->mai", volumes, stress, gradients)
    force, sizes = np.zeros(x.shape), np.zeros(len(x))
    np.add.at(force, body.tets, parts)
    np.add.at(sizes, body.tets, np.linalg.norm(parts, axis=2))
    least = (volumes * body.young)[:, None] * np.linalg.norm(gradients, axis=2) * SMALL_STRAIN
    floor = np.zeros(len(x))
    np.add.at(floor, body.tets, least)
    for spring in body.springs:
        pull = spring.stiffness[:, None] * (spring.points @ x - spring.targets)
        force += spring.points.T @ pull
        sizes += abs(spring.points).T @ np.linalg.norm(pull, axis=1)
    judged = ~body.pushed
    judged[np.unique(body.tets[np.linalg.det(elastic) < CRUSHED])] = False
    share = np.linalg.norm(force, axis=1) / np.maximum(sizes, floor)
    return Unbalance(float(share[judged].max(initial=0.0)), float(judged.mean()))


def first_piola(f: Array, young: Array, poisson: float) -> Array:
    """Stresses (m, 3, 3) in kPa: derivatives of the energy density of docs/fem.md (Smith et al. 2018)."""
    mu, lam = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    m, bulk = 4 / 3 * mu, lam + 5 / 6 * mu
    out = np.empty(f.shape)
    for i in range(3):
        for k in range(3):
            moved = f.astype(complex)
            moved[:, i, k] += 1j * STEP
            squares, volume = (moved**2).sum(axis=(1, 2)), np.linalg.det(moved)
            energy = m / 2 * (squares - 3 - np.log((squares + 1) / 4)) + bulk / 2 * (volume - 1) ** 2
            out[:, i, k] = (energy - 0.75 * m * (volume - 1)).imag / STEP
    return out


def _matrices(strains: Array) -> Array:
    return np.asarray(strains)[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def of_tissue(layer: TissueLayer, frame: Frame, shapes: Mapping[str, Shapes]) -> Unbalance:
    """Of the fat or the one soft tissue in a frame."""
    tissue, mesh = layer.tissue, shapes[layer.name][layer.name + "_mesh"]
    x, settled = mesh.vertices, not mesh.figures.get("unsettled", 0.0)
    pushed: BoolArray = np.zeros(len(x), dtype=np.bool_)
    springs = []
    for potential in layer.load_case(frame.bones, shapes).constraints(x):
        if isinstance(potential, Attachment):
            springs.append(Springs(potential.operator, potential.targets, potential.stiffness))
            continue
        assert isinstance(potential, Sliding | SurfaceSliding)  # contact is one-sided sliding
        at = potential.points(x)
        touch = TOUCH if settled else np.inf  # unsettled: planes of the frame are not those of here
        rows = potential.heights(at) < touch if isinstance(potential, Contact) else np.full(len(at), True)
        pushed |= abs(potential.operator).T @ rows > 0
    pushed |= _near_skin(tissue, x)
    given = layer.elastic_bodies(frame.bones)[layer.name + "_mesh"]
    return unbalance(_body(given, springs, pushed), x)


def _near_skin(tissue: Tissue, x: Array) -> BoolArray:
    """Vertices (n,) that the barrier of the skin against itself may push."""
    barrier = tissue.skin_barrier() if tissue.skin_contact else None
    return np.zeros(len(x), dtype=np.bool_) if barrier is None else barrier.force_sizes(x) > 0


def of_muscles(layer: MuscleLayer, frame: Frame, shapes: Mapping[str, Shapes]) -> Unbalance:
    """Of all muscles or ligaments in a frame; the worst of them, and the mean share of their vertices."""
    options, flesh = layer.options, shapes.get("flesh", {}).get("flesh_mesh")
    bones = {n: Surface(s.rest, s.cells) for n, s in shapes["bones"].items()}
    posed = [Surface(s.vertices, s.cells) for s in shapes["bones"].values()]
    bodies, found = layer.elastic_bodies(frame.bones), []
    for muscle in layer.muscles:
        x = shapes[layer.name][f"{muscle.name}_mesh"].vertices
        others = [
            Surface(shapes[layer.name][m.name].vertices, m.body.surface.triangles)
            for m in layer.muscles
            if m is not muscle
        ]
        surface, places = (
            muscle.body.surface,
            muscle.places(bones, frame.bones, None if flesh is None else flesh.vertices),
        )
        free = np.setdiff1d(np.arange(len(surface.vertices)), muscle.firm)
        points = muscle.body.matrix[free]
        area = mass_lumped(surface.vertices, surface.triangles)[free]
        targets = muscle.targets(frame.bones)
        springs = [
            Springs(muscle.anchors, targets, np.full(len(targets), options.spring)),
            Springs(points, points @ places, options.bed * area),
        ]
        near = _within(points @ x, posed, TOUCH) | _within(points @ x, others, NEAR)
        every = muscle.body.matrix
        near_any = _within(every @ x, others, NEAR)  # that another muscle's vertices may press on
        pushed = (abs(points).T @ near > 0) | (abs(every).T @ near_any > 0)
        found.append(unbalance(_body(bodies[f"{muscle.name}_mesh"], springs, pushed), x))
    return Unbalance(max(u.largest for u in found), float(np.mean([u.judged for u in found])))


def _body(given: Elastic, springs: Sequence[Springs], pushed: BoolArray) -> Body:
    young = given.weights * np.broadcast_to(given.material.young, len(given.tets))
    poisson = float(np.max(given.material.poisson))
    return Body(given.vertices, given.tets, young, poisson, _matrices(given.strains), springs, pushed)


def _within(points: Array, surfaces: Sequence[Surface], reach: float) -> BoolArray:
    """Which points (k,) are within reach of a surface, or in it."""
    found: BoolArray = np.zeros(len(points), dtype=np.bool_)
    for surface in surfaces:
        found |= Distance(surface).signed(points)[0] < reach
    return found
