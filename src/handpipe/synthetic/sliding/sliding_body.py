"""A body whose parts slide on one another and on bones without friction, and its equilibria."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.fem.contact import Barrier
from handpipe.fem.elements import Material
from handpipe.fem.minimisation import Record
from handpipe.fem.potentials import Membrane, Potential
from handpipe.fem.solver import Equilibrium, Options, approach, solve
from handpipe.mesh.surfaces import Surface, component_labels, concatenate
from handpipe.synthetic.continuum.active import HillFibres
from handpipe.synthetic.continuum.voids import VoidPressure
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody, CoupledPose
from handpipe.synthetic.coupled.uninverted import uninverted

log = logging.getLogger(__name__)

PASSING = 4  # iterations for an intermediate state, which need not converge
NO_BONES = np.zeros((0, 3))


@dataclass(frozen=True)
class Interfaces:
    """How surfaces press on one another.

    Parameters
    ----------
    distance, stiffness : float
        Activation distance in mm and stiffness in kPa of the barrier between all surfaces (`Barrier`).
    suction : float
        Pressure in kPa that keeps the voids between bodies closed (`VoidPressure`).
    skin : Material
        Of the skin, a membrane on the outer surface.
    thickness : float
        Of the skin in mm.
    """

    distance: float
    stiffness: float
    suction: float
    skin: Material
    thickness: float


class Interface(Barrier):
    """A barrier whose contacts change in each iteration: no sparsity pattern of its Hessian would last.

    Without the pattern that `Barrier` holds, the Hessian takes a third of the work.
    """

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm; with `project`, made semidefinite pair by pair."""
        return self._reduce(self._local_hessian(x, project))


class SlidingBody(CoupledBody):
    """Several bodies, in one mesh without common vertices: the first surrounds the others and the bones.

    `walls` (k, 3) are the faces that bound the void between the bodies, `outer` (f, 3) those of the skin, all
    of nodes; `bones` the rigid bodies in it. The anatomy's `bones` have the vertices attached to each.
    Fibres of muscles follow a force-length law.
    """

    def __init__(
        self,
        anatomy: CoupledAnatomy,
        bones: Mapping[str, Surface],
        materials: Mapping[str, Material],
        interfaces: Interfaces,
        *,
        order: Literal[1, 2] = 1,
    ) -> None:
        super().__init__(anatomy, materials, order=order)
        self.bones, self.interfaces = dict(bones), interfaces
        faces = self.cells.boundary_faces()[0]
        part = component_labels(faces)
        farthest = int(part[self.rest[faces, 0].max(axis=1).argmax()])
        self.outer, inner = faces[part == farthest], faces[part != farthest]
        self.walls = inner[:, ::-1].copy()
        self.skin_faces = self.outer
        self.skin = Membrane(self.rest, self.outer, interfaces.skin, interfaces.thickness)
        self.void = VoidPressure(self.walls, len(self.rest), interfaces.suction)
        used, triangles = np.unique(faces, return_inverse=True)
        rigid = concatenate(list(self.bones.values())) if self.bones else None
        self.barrier = Interface(
            sp.eye(len(self.rest), format="csr")[used],
            triangles.reshape(-1, 3),
            self.rest,
            interfaces.distance,
            interfaces.stiffness,
            obstacle=None if rigid is None else (rigid.vertices, rigid.triangles),
        )

    def potentials(self, pose: CoupledPose) -> list[Potential]:
        """Energies in a pose, without contact."""
        return [*super().potentials(pose), self.skin, self.void]

    def energies(self, pose: CoupledPose) -> list[Potential]:
        """Energies in a pose, with contact of the bodies among themselves and with the bones there."""
        assert self.barrier is not None
        return [*self.potentials(pose), self.barrier.with_obstacle(self.bone_vertices(pose.bones))]

    def bone_vertices(self, transforms: Mapping[str, RigidTransform]) -> Array:
        """Vertices (o, 3) of all bones in a pose."""
        placed = [transforms[name](bone.vertices) for name, bone in self.bones.items()]
        return np.concatenate(placed) if placed else NO_BONES

    def faces_of(self, region: str) -> IntArray:
        """Faces (k, 3) of nodes on the surface of a region."""
        tets = self.cells.tets[self.cell_labels == self.anatomy.regions.index(region)]
        return replace(self.cells, tets=tets).boundary_faces()[0]

    def _active(self) -> HillFibres:
        cells = self.elements.part(np.concatenate(list(self.muscles.values())))
        return HillFibres(cells, np.concatenate(list(self.anatomy.fibres.values())), 0.0)


def follow(
    body: SlidingBody,
    motion: Callable[[float], CoupledPose],
    x: Array | None = None,
    *,
    steps: int,
    options: Options,
) -> Equilibrium:
    """The equilibrium at motion(1), followed from x (n, 3) at motion(0), by default the rest shape.

    Bones and what is attached to them move in so many steps, each as far as is free of collisions. Only the
    last state is solved until it converges.

    Raises
    ------
    ConvergenceError
        If no equilibrium is found, or tissue stays inverted.
    """
    x = body.rest if x is None else x
    passing, record = replace(options, allow_partial=True, max_iterations=PASSING), Record()
    assert body.barrier is not None
    barrier = body.barrier.with_obstacle(body.bone_vertices(motion(0.0).bones))
    for number in range(steps):
        pose = motion((number + 1) / steps)
        found, barrier = approach(
            body.potentials(pose),
            barrier,
            x,
            body.bone_vertices(pose.bones),
            fixed=body.fixed,
            target=body.prescribed(pose, x),
            options=passing,
        )
        x = found.x
        record.add(found.record)
        log.info(
            "%s: step %d of %d, gap %.3g mm, %d inverted",
            options.name,
            number + 1,
            steps,
            barrier.gap(x),
            body.inverted(x),
        )
    energies = [*body.potentials(motion(1.0)), barrier]
    found = solve(energies, x, fixed=body.fixed, options=options)
    record.add(found.record)
    return uninverted(body, energies, Equilibrium(found.x, record), options)
