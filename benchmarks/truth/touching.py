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
DISTANCE, FAR = 0.02, 0.3  # mm below which the barrier pushes; the hand's skin has the latter
TOUCHING = 0.1  # mm: nodes as near as this to the other skin are in contact
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

    def ours(self) -> tuple[Array, Array]:
        """Our equilibria (n, 3) with barriers that act within FAR and within DISTANCE."""
        used, triangles = np.unique(self.skin, return_inverse=True)
        choice, x = sp.eye(len(self.body.rest), format="csr")[used], self.body.rest
        near = Barrier(choice, triangles.reshape(-1, 3), x, DISTANCE, YOUNG)
        far, fixed = near.reaching(FAR), self.body.fixed
        for step in range(STEPS):
            target = self.target((step + 1) / STEPS, x)
            found = approach([self.law], far, x, NO_OBSTACLE, fixed=fixed, target=target, options=PASSING)
            x = found[0].x
        x = solve([self.law, far], x, fixed=fixed, options=OPTIONS).x
        return x, solve([self.law, near], x, fixed=fixed, options=OPTIONS).x

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

    def apart(self, x: Array, y: Array) -> Array:
        """Distances (k,) of the free nodes at x and y (n, 3)."""
        return np.asarray(np.linalg.norm(x - y, axis=1)[~self.body.fixed[::3]])

    def skins(self) -> tuple[IntArray, IntArray]:
        """Triangles (k, 3) of nodes on the lower and on the upper skin."""
        of_upper = np.unique(self.body.elements.cells[self.anatomy.labels == 1])
        upper = np.isin(self.skin[:, 0], of_upper)
        return self.skin[~upper], self.skin[upper]

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

    Over free nodes, and over the contact surface: our lower skin within TOUCHING of the upper one, from
    CalculiX's lower skin. `engine_contact_refinement_*` compare each engine with itself on the finer mesh.
    """
    if PROGRAM is None:
        log.warning("CalculiX (ccx) is not installed; the figures engine_contact_* are left out")
        return {}
    coarse = Solved.of(Fingertips(fingertips(edge_length)))
    found = coarse.figures("")
    if refined:
        fine = Solved.of(Fingertips(coarse.tips.anatomy.refined()))  # its nodes begin with the coarse ones
        found |= fine.figures("_refined")
        for name, x, y in (("ours", coarse.ours, fine.ours), ("theirs", coarse.theirs, fine.theirs)):
            error = coarse.tips.apart(x, y[: len(x)])
            found[f"engine_contact_refinement_mean_{name}"] = (float(error.mean()), "mm")
    return found


@dataclass(frozen=True, eq=False)
class Solved:
    """Fingertips and their equilibria (n, 3): ours with barriers of two reaches, and CalculiX's."""

    tips: Fingertips
    far: Array
    ours: Array
    theirs: Array

    @staticmethod
    def of(tips: Fingertips) -> Solved:
        """By both engines."""
        return Solved(tips, *tips.ours(), tips.theirs())

    def figures(self, suffix: str) -> Metrics:
        """Differences on this mesh."""
        tips = self.tips
        apart, contact = tips.apart(self.ours, self.theirs), self._contact_surface()
        ours, theirs = tips.force(self.ours), tips.force(self.theirs)
        figures = {
            "tets": (len(tips.anatomy.mesh.tets), "1"),
            "difference_mean": (float(apart.mean()), "mm"),
            "difference_max": (float(apart.max()), "mm"),
            "difference_mean_far": (float(tips.apart(self.far, self.theirs).mean()), "mm"),
            "surface_difference_mean": (float(contact.mean()), "mm"),
            "surface_difference_max": (float(contact.max()), "mm"),
            "force": (ours, "mN"),
            "force_difference": (100.0 * abs(theirs / ours - 1.0), "%"),
        }
        return {f"engine_contact_{name}{suffix}": value for name, value in figures.items()}

    def _contact_surface(self) -> Array:
        """Distances (k,) of our lower skin's nodes in contact from CalculiX's lower skin."""
        low, high = self.tips.skins()
        nodes = np.unique(low)
        near = Distance(Surface(self.ours, high)).closest(self.ours[nodes])[0] < TOUCHING
        return np.abs(Distance(Surface(self.theirs, low)).closest(self.ours[nodes[near]])[0])
