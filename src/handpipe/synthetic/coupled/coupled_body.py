"""One body of muscles, fat and skin about bones: a conforming mesh, and the energies of its tissues."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray, InputError, IntArray, RigidTransform
from handpipe.fem.contact import Barrier
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Potential
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh
from handpipe.synthetic.continuum.active import ActiveFibres
from handpipe.synthetic.continuum.balls import ball_means
from handpipe.synthetic.continuum.crushing import LAST, QuadratureCrushing
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.continuum.refinement import Midpoints, refine
from handpipe.synthetic.continuum.solid import Solid
from handpipe.synthetic.continuum.strands import Cable, Strands, chain
from handpipe.synthetic.continuum.surfaces import bone_faces, bone_weights, outer_faces

CRUSH_STIFFNESS = 10.0  # kPa
LARGE = 150_000  # nodes, whose factor of 20 GiB would not fit


@dataclass(frozen=True, eq=False)
class TendonStrand:
    """A tendon's points (k, 3) in mm at rest, its stiffness (Young's modulus times area) in mN.

    `bones` names the bone on which a point of that number ends; each other is the mean of the tissue within
    `radius` mm: without it a taut strand would cut through ever finer meshes. A strand without stiffness
    slides along its points, and pulls with its `tension` in mN whatever its length.
    """

    points: Array
    stiffness: float = 0.0
    bones: Mapping[int, str] = field(default_factory=dict)
    radius: float = 1.0
    tension: float = 0.0


@dataclass(frozen=True, eq=False)
class CoupledAnatomy:
    """Anatomy of a coupled body at rest.

    labels (m,) number the `regions` of the tets; `bones` has the mesh's vertices on each bone's surface,
    within which there are no tets; `fibres` the unit directions (f, 3) of the tets of each region that is a
    muscle.
    """

    mesh: TetMesh
    labels: IntArray
    regions: tuple[str, ...]
    bones: Mapping[str, IntArray]
    fibres: Mapping[str, Array] = field(default_factory=dict)
    strands: Mapping[str, TendonStrand] = field(default_factory=dict)

    def tets_of(self, region: str) -> IntArray:
        """Numbers of a region's tets."""
        return np.flatnonzero(self.labels == self.regions.index(region))

    def part(self, kept: IntArray | BoolArray) -> tuple[CoupledAnatomy, IntArray]:
        """The anatomy of some tets, by number or mask, and its vertices' (n,) numbers in the whole."""
        mesh, used = self.mesh.part(kept)
        number = np.full(len(self.mesh.vertices), -1)
        number[used] = np.arange(len(used))
        bones = {name: number[on][number[on] >= 0] for name, on in self.bones.items()}
        left = np.zeros(len(self.labels), dtype=bool)
        left[kept] = True
        fibres = {name: along[left[self.tets_of(name)]] for name, along in self.fibres.items()}
        return replace(self, mesh=mesh, labels=self.labels[kept], bones=bones, fibres=fibres), used

    def refined(self) -> CoupledAnatomy:
        """The same body with every tet cut into eight."""
        mesh, parents = refine(self.mesh)
        middle = Midpoints.build(self.mesh)
        fibres = {name: np.repeat(along, 8, axis=0) for name, along in self.fibres.items()}
        bones = {n: middle.on_faces(bone_faces(self.mesh, on)) for n, on in self.bones.items()}
        return CoupledAnatomy(mesh, self.labels[parents], self.regions, bones, fibres, self.strands)


@dataclass(frozen=True)
class CoupledPose:
    """Where bones are, from rest, and the tension in kPa of each muscle; others are slack."""

    bones: Mapping[str, RigidTransform]
    tensions: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SkinContact:
    """Contact of the skin with itself: the distance in mm below which it pushes, its stiffness in kPa."""

    distance: float
    stiffness: float


class CoupledBody:
    """The coupled body: quadratic (or linear) elements on an anatomy's mesh, and their potentials.

    `materials` gives each region's; skin_faces (k, 3) are the triangles of nodes on the outer surface, of a
    quadratic face the four between its nodes; `on_bones` the nodes on each bone; `cells` the tets between
    nodes, with `cell_labels`; `muscles` the tets of each; `order` 2 or 1.

    Raises
    ------
    InputError
        If a region has no material or fibres do not fit.
    """

    def __init__(
        self,
        anatomy: CoupledAnatomy,
        materials: Mapping[str, Material],
        *,
        order: Literal[1, 2] = 2,
        contact: SkinContact | None = None,
    ) -> None:
        missing = set(anatomy.regions) - set(materials)
        if missing:
            raise InputError("body", "materials", f"lacks {sorted(missing)}", "Give one for each region")
        self.anatomy = anatomy
        mesh, self.order = anatomy.mesh, order
        self.elements = Elements.quadratic(mesh) if order == 2 else Elements.linear(mesh)
        self.rest = self.elements.nodes
        constants = [(materials[r].young, materials[r].poisson) for r in anatomy.regions]
        young, poisson = np.array(constants, dtype=float).T[:, anatomy.labels]
        self.solid = Solid(self.elements, Material(young, poisson))
        self.muscles = {name: anatomy.tets_of(name) for name in anatomy.fibres}
        self.fibres = self._active() if self.muscles else None
        fine = anatomy.refined() if order == 2 else anatomy  # whose vertices are the nodes
        self.on_bones, self.cells, self.cell_labels = fine.bones, fine.mesh, fine.labels
        self.skin_faces = outer_faces(fine.mesh, fine.bones.values())
        self.crushing = QuadratureCrushing(self.elements, CRUSH_STIFFNESS)
        self.strands = {name: self._strand(name) for name in anatomy.strands}
        self.barrier = self._barrier(contact) if contact is not None else None

    @property
    def fixed(self) -> BoolArray:
        """Mask (3n,) of the degrees of freedom of nodes on bones, which are fixed."""
        constrained = np.zeros(len(self.rest), dtype=bool)
        for nodes in self.on_bones.values():
            constrained[nodes] = True
        return np.repeat(constrained, 3)

    @property
    def coarse(self) -> sp.csr_matrix | None:
        """For `Options`: fields of linear tets, where there are too many nodes for a factor."""
        return self.elements.prolongation() if len(self.rest) > LARGE else None

    def potentials(self, pose: CoupledPose) -> list[Potential]:
        """Energies of the tissues in a pose, without contact."""
        found: list[Potential] = [self.solid, self.crushing, *self.strands.values()]
        if self.fibres is not None and any(pose.tensions.values()):
            tension = [np.full(len(t), pose.tensions.get(name, 0.0)) for name, t in self.muscles.items()]
            found.append(self.fibres.with_tension(np.concatenate(tension)))
        return found

    def energies(self, pose: CoupledPose) -> list[Potential]:
        """Energies in a pose, with contact where there is any."""
        return self.potentials(pose) + ([self.barrier] if self.barrier is not None else [])

    def prescribed(self, pose: CoupledPose, x: Array) -> Array:
        """Positions x (n, 3) with the nodes on bones where the pose has them."""
        out = x.copy()
        for name, nodes in self.on_bones.items():
            out[nodes] = pose.bones[name](self.rest[nodes])
        return out

    def strand_points(self, name: str) -> sp.csr_matrix:
        """Matrix (k, n) from nodes to the points of a strand."""
        strand = self.anatomy.strands[name]
        matrix = ball_means(self.elements, strand.points, strand.radius).tolil()
        for point, bone in strand.bones.items():
            matrix[point] = bone_weights(
                strand.points[point], self.anatomy.mesh, self.anatomy.bones[bone], len(self.rest)
            )
        return matrix.tocsr()

    def inverted(self, x: Array) -> int:
        """Number of quadrature points, and of tets between nodes, that are inverted at x (n, 3)."""
        points = int((self.solid.volume_ratios(x) <= 0).sum())
        return points + int((self.cells.moved(x).volumes() <= 0).sum())

    def crushed(self, x: Array, left: float = 0.0) -> BoolArray:
        """Elements (m,) with this share of volume or less at a quadrature point, at x (n, 3)."""
        return np.asarray((self.solid.volume_ratios(x) <= left).any(axis=1))

    def inside_out(self, x: Array) -> BoolArray:
        """Elements (m,) that are inverted at a quadrature point, or between nodes, at x (n, 3)."""
        return self.crushed(x) | self.folded(x)

    def folded(self, x: Array, left: float = 0.0) -> BoolArray:
        """Quadratic tets (m,) of which a tet between nodes has this share of volume or less at x (n, 3)."""
        count = len(self.elements.cells)
        if self.order == 1:
            return np.zeros(count, dtype=bool)
        shares = self.cells.moved(x).volumes() / self.cells.volumes()
        return np.asarray(shares.reshape(count, -1).min(axis=1) <= left)

    def between_nodes(self, cells: BoolArray, last: float = LAST) -> QuadratureCrushing:
        """Resistance to crushing of the tets between the nodes of cells (m,), logarithmic down to `last`."""
        chosen = self.cells.tets[np.repeat(cells, len(self.cells.tets) // len(cells))]
        return QuadratureCrushing(Elements.linear(TetMesh(self.rest, chosen)), CRUSH_STIFFNESS).to_the_end(
            last
        )

    def surface(self, region: str, x: Array) -> Surface:
        """The surface of a region's tets, straight between all nodes, at positions x (n, 3)."""
        tets = self.cells.tets[self.cell_labels == self.anatomy.regions.index(region)]
        return TetMesh(x, tets).boundary().compact()

    def volume(self, region: str, x: Array) -> float:
        """Volume in mm^3 of a region at positions x (n, 3)."""
        chosen = self.anatomy.tets_of(region)
        return float((self.solid.volume_ratios(x)[chosen] * self.elements.volumes[chosen]).sum())

    def _active(self) -> ActiveFibres:
        """All muscles in one potential, in their order."""
        cells = self.elements.part(np.concatenate(list(self.muscles.values())))
        return ActiveFibres(cells, np.concatenate(list(self.anatomy.fibres.values())), 0.0)

    def _strand(self, name: str) -> Strands | Cable:
        strand, points = self.anatomy.strands[name], self.strand_points(name)
        segments = chain(len(strand.points))
        if strand.stiffness == 0.0:
            return Cable(points, segments, strand.tension)
        return Strands(points, segments, self.rest, strand.stiffness)

    def _barrier(self, contact: SkinContact) -> Barrier:
        used, triangles = np.unique(self.skin_faces, return_inverse=True)
        choice = sp.eye(len(self.rest), format="csr")[used]
        return Barrier(choice, triangles.reshape(-1, 3), self.rest, contact.distance, contact.stiffness)
