"""Two fingertips of tissue pressed on one another, crosswise: our barrier contact against CalculiX's."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from benchmarks.truth.calculix import PROGRAM, Deck
from benchmarks.truth.filling import fill
from benchmarks.truth.isochoric import IsochoricSolid
from benchmarks.truth.toy import capsule_surface
from handpipe.core import Array, BoolArray, IntArray, Metrics, RigidTransform
from handpipe.fem.contact import Barrier
from handpipe.fem.elements import Material
from handpipe.fem.solver import Options, approach, solve
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody, CoupledPose

log = logging.getLogger(__name__)

START, END = (
    np.array([-3.0, 0.0, 0.0]),
    np.array([3.0, 0.0, 0.0]),
)  # of the lower tip's axis; the upper's is y
RADIUS, BONE_RADIUS = 5.0, 2.0
APART, DOWN = 0.3, 2.5  # mm: gap at rest, way of the upper bone
YOUNG = 6.0  # kPa
TISSUE = Material(YOUNG, 0.45)
DISTANCE = 0.02  # mm below which the barrier pushes
STEPS = 4
NO_OBSTACLE = np.zeros((0, 3))
OPTIONS = Options(displacement_tolerance=1e-8, force_tolerance=1e-8, name="fingertips")
PASSING = replace(OPTIONS, allow_partial=True, max_iterations=8)
NAMES = ("lower", "upper")


def fingertips(edge_length: float) -> CoupledAnatomy:
    """Two capsules of tissue about bones, in one mesh that has no vertex in common."""
    surfaces = {
        "skin": capsule_surface(START, END, RADIUS, edge_length),
        "bone": capsule_surface(START, END, BONE_RADIUS, 0.7 * edge_length),
    }
    one, _, on = fill(surfaces, {"tissue": ("skin", ["bone"])}, edge_length)
    count, turned = len(one.vertices), one.vertices[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    turned[:, 2] += one.vertices[:, 2].max() - turned[:, 2].min() + APART
    mesh = TetMesh(np.concatenate([one.vertices, turned]), np.concatenate([one.tets, one.tets + count]))
    bones = {"lower": on["bone"], "upper": on["bone"] + count}
    return CoupledAnatomy(mesh, np.repeat([0, 1], len(one.tets)), NAMES, bones)


@dataclass(frozen=True, eq=False)
class Fingertips:
    """The body of both fingertips and its law."""

    anatomy: CoupledAnatomy

    @cached_property
    def body(self) -> CoupledBody:
        """Its elements and nodes; their energies are not used."""
        return CoupledBody(self.anatomy, dict.fromkeys(NAMES, TISSUE))

    @cached_property
    def law(self) -> IsochoricSolid:
        """Energy of the tissue, the same for both engines."""
        return IsochoricSolid(self.body.elements, TISSUE)

    @cached_property
    def skin(self) -> IntArray:
        """Triangles (k, 3) of nodes on the skins."""
        faces = self.body.cells.boundary_faces()[0]
        return faces[~self._on_bone(faces, self.body.on_bones.values())]

    def target(self, share: float, x: Array) -> Array:
        """Positions (n, 3) with the bones at a share of the way."""
        down = RigidTransform(np.eye(3), np.array([0.0, 0.0, -DOWN * share]))
        return self.body.prescribed(CoupledPose({"lower": RigidTransform.identity(), "upper": down}), x)

    def ours(self) -> Array:
        """Our equilibrium (n, 3), by a barrier that acts within DISTANCE."""
        used, triangles = np.unique(self.skin, return_inverse=True)
        choice, x = sp.eye(len(self.body.rest), format="csr")[used], self.body.rest
        near = Barrier(choice, triangles.reshape(-1, 3), x, DISTANCE, YOUNG)
        for distance in (5 * DISTANCE, DISTANCE):
            barrier = near.reaching(distance)
            for step in range(STEPS if distance > DISTANCE else 0):
                target = self.target((step + 1) / STEPS, x)
                found = approach(
                    [self.law], barrier, x, NO_OBSTACLE, fixed=self.body.fixed, target=target, options=PASSING
                )
                x = found[0].x
            x = solve([self.law, barrier], x, fixed=self.body.fixed, options=OPTIONS).x
        return x

    def theirs(self) -> Array:
        """Equilibrium (n, 3) of CalculiX."""
        rest, cells = self.body.rest, self.body.elements.cells
        deck = Deck(
            rest, cells, self.law.moduli, self.body.fixed[::3], [self.target(1.0, rest)], self._sides()
        )
        with tempfile.TemporaryDirectory() as folder:
            return deck.run(Path(folder))[-1]

    def force(self, x: Array) -> float:
        """Force in mN by which the tissue pushes the upper bone up."""
        return -float(self.law.gradient(x)[self.body.on_bones["upper"], 2].sum())

    def _sides(self) -> tuple[IntArray, IntArray]:
        """The skins' tets and the corners opposite to their faces, of the lower and the upper tip."""
        mesh = self.anatomy.mesh
        faces, cells = mesh.boundary_faces()
        skin = ~self._on_bone(faces, self.anatomy.bones.values())
        opposite = (mesh.tets[cells][:, :, None] != faces[:, None, :]).all(axis=2).argmax(axis=1)
        rows, upper = np.column_stack([cells, opposite])[skin], self.anatomy.labels[cells][skin] == 1
        return rows[~upper], rows[upper]

    @staticmethod
    def _on_bone(faces: IntArray, bones: Iterable[IntArray]) -> BoolArray:
        return np.any([np.isin(faces, nodes).all(axis=1) for nodes in bones], axis=0)


def contact_differences(edge_length: float, *, refined: bool = True) -> Metrics:
    """Differences between the engines' contact in mm, on a mesh and on its refinement; none without CalculiX.

    Over free nodes, and over the contact surface: our lower skin within five activation distances of the
    upper one, from CalculiX's lower skin. `engine_contact_refinement_*` compare our coarse and fine bodies.
    """
    if PROGRAM is None:
        log.warning("CalculiX (ccx) is not installed; the figures engine_contact_* are left out")
        return {}
    coarse = Fingertips(fingertips(edge_length))
    x = coarse.ours()
    found = _differences(coarse, x, "")
    if refined:
        fine = Fingertips(coarse.anatomy.refined())
        y = fine.ours()
        found |= _differences(fine, y, "_refined")
        corners = len(coarse.body.rest)
        apart = np.linalg.norm(y[:corners] - x, axis=1)[~coarse.body.fixed[::3]]
        found["engine_contact_refinement_mean"] = (float(apart.mean()), "mm")
    return found


def _differences(tips: Fingertips, x: Array, suffix: str) -> Metrics:
    """Figures of one mesh, given our equilibrium (n, 3)."""
    z = tips.theirs()
    free = ~tips.body.fixed[::3]
    apart = np.linalg.norm(x - z, axis=1)[free]
    contact = _contact_surface(tips, x, z)
    ours, theirs = tips.force(x), tips.force(z)
    figures = {
        "tets": (len(tips.anatomy.mesh.tets), "1"),
        "difference_mean": (float(apart.mean()), "mm"),
        "difference_max": (float(apart.max()), "mm"),
        "surface_difference_mean": (float(contact.mean()), "mm"),
        "surface_difference_max": (float(contact.max()), "mm"),
        "force": (ours, "mN"),
        "force_difference": (100.0 * abs(theirs / ours - 1.0), "%"),
    }
    return {f"engine_contact_{name}{suffix}": value for name, value in figures.items()}


def _contact_surface(tips: Fingertips, x: Array, z: Array) -> Array:
    """Distances (k,) of our lower skin's nodes in contact from CalculiX's lower skin."""
    upper = np.isin(tips.skin, np.unique(tips.body.elements.cells[tips.anatomy.labels == 1])).all(axis=1)
    low, high = tips.skin[~upper], tips.skin[upper]
    nodes = np.unique(low)
    near = Distance(Surface(x, high)).closest(x[nodes])[0] < 5 * DISTANCE
    return np.abs(Distance(Surface(z, low)).closest(x[nodes[near]])[0])
