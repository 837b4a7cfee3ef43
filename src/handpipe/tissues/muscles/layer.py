"""The muscles as a layer of the simulation.

It is one static equilibrium of all muscles that may touch one another (Zheng 2022 §4.1).
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from handpipe.core import (
    LAYERS,
    Array,
    BoolArray,
    ConvergenceError,
    Frame,
    RigidTransform,
    Shape,
    Shapes,
    SimulatedFrame,
    flesh_in,
)
from handpipe.fem.contact import Attachment
from handpipe.fem.elements import Validity
from handpipe.fem.minimisation import Equilibrium
from handpipe.fem.potentials import Elastic, Potential, Viscous
from handpipe.fem.solver import NearEnough, Settled, equilibrium, settle
from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.surfaces import BodyDistances, Distance, Surface, each_moved
from handpipe.mesh.tets import mass_lumped
from handpipe.tissues.muscles.barrier import MusclesInFrame, kept_apart, no_room
from handpipe.tissues.muscles.colliding import Bodies, held_vertices
from handpipe.tissues.muscles.contacts import MuscleContacts, free_points
from handpipe.tissues.muscles.muscle import Muscle
from handpipe.tissues.muscles.options import SimulationOptions
from handpipe.tissues.muscles.penetration import Penetration, Posed

log = logging.getLogger(__name__)

# mm and 1: tolerances of a start; it may end before it has converged
ROUGHLY: dict[str, Any] = {
    "displacement_tolerance": 0.01,
    "force_tolerance": 1.0,
    "max_iterations": 30,
    "allow_partial": True,
    "untangle": False,
}
STILL, LOOSE, LONGEST = 1e-3, 1e-3, 3.0  # mm, 1 and mm: tolerances of moves and forces, and the longest step


class MuscleLayer(Viscous):
    """Muscles of loaded artifacts as a layer of the simulation.

    Parameters
    ----------
    muscles : iterable of Muscle
        The muscles.
    options : SimulationOptions, optional
        Material, stiffnesses and contact limits.
    contact : bool
        Whether muscles touch bones and one another.
    examples : sequence of mapping of str to Surface
        Surfaces of the muscles in known poses, in mm, which tell what slides on what.
    """

    name = "muscles"
    needs = LAYERS[name].needs

    def __init__(
        self,
        muscles: Iterable[Muscle],
        options: SimulationOptions | None = None,
        *,
        contact: bool = True,
        examples: Sequence[Mapping[str, Surface]] = (),
    ) -> None:
        self.muscles, self.options, self.contact = list(muscles), options or SimulationOptions(), contact
        sizes = [len(m.body.mesh.vertices) for m in self.muscles]
        starts = np.cumsum([0, *sizes])
        self.parts = [slice(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True)]
        rest = np.concatenate([m.body.mesh.vertices for m in self.muscles])
        tets = [m.body.mesh.tets + a for m, a in zip(self.muscles, starts, strict=False)]
        self.elastic = Elastic(rest, np.concatenate(tets), self.options.material)
        self.surfaces = [self._lifted(m.body.matrix, i) for i, m in enumerate(self.muscles)]
        self.free_points = free_points(self.muscles, self.surfaces)
        anchors = [self._lifted(m.anchors, i) for i, m in enumerate(self.muscles)]
        self.anchors = sparse.vstack(anchors, format="csr")  # and to the points attached to bones
        self.contacts = MuscleContacts.of(self.muscles, self.options, examples)
        self._to_bones = BodyDistances()

    def behind_barrier(self) -> MuscleLayer:
        """The same layer, its muscles kept apart by a barrier."""
        other = copy.copy(self)
        other.options = replace(self.options, barrier=True)
        return other

    def by_inverse_distance(self) -> MuscleLayer:
        """The same layer, the muscles' strains and places interpolated by the weights of Zheng 2022 Eq. 1."""
        other = copy.copy(self)
        other.muscles = [replace(m, space=m.space.by_inverse_distance()) for m in self.muscles]
        return other

    def _lifted(self, own: sparse.csr_matrix, index: int) -> sparse.csr_matrix:
        """Matrix (k, N) on all vertices from one (k, n) on those of one muscle."""
        part = self.parts[index]
        shape = (own.shape[0], len(self.elastic.vertices))
        return sparse.csr_matrix((own.data, own.indices + part.start, own.indptr), shape=shape)

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """Each muscle's surface, and its tetrahedra under `{muscle}_mesh` with the field "strain" (m, 6).

        The surfaces' figures tell how the contact of all muscles settled, and how deep a muscle lies in other
        bodies or they in it (mm); those of the tets whether they are valid.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium, or muscles cannot be kept apart behind the barrier.
        """
        places = np.concatenate(self._places(frame, below))
        return self._near(places, places, frame, below)

    def solve_after(self, before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `solve`, near the muscles of another frame.

        A muscle begins as far from its surroundings as it is in that frame, in directions that turn with its
        reference bone. Where their contact does not settle from there, the muscles of `solve` are taken if
        theirs does: a place that muscles slide out of is not handed on from frame to frame. Viscous muscles
        resist their way from there.

        Raises
        ------
        ConvergenceError
            As `solve`.
        """
        then, shapes = before
        own = [shapes[self.name][f"{muscle.name}_mesh"].vertices for muscle in self.muscles]
        return self.moving_from(np.concatenate(own), self.elastic)._after(own, before, frame, below)

    def _after(
        self, own: Sequence[Array], before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]
    ) -> Shapes:
        """The shapes of `solve_after`, from the muscles' own vertices in the frame before."""
        then, starts = before[0], []
        were, are = self._places(*before), self._places(frame, below)
        for muscle, x, was, place in zip(self.muscles, own, were, are, strict=True):
            bone = muscle.space.reference
            turn = frame.bones[bone].rotation @ then.bones[bone].rotation.T
            starts.append(place + (x - was) @ turn.T)
        places = np.concatenate(are)
        shapes_after = self._near(np.concatenate(starts), places, frame, below)
        if _settled(shapes_after):
            return shapes_after
        log.info(
            "%s of %s: contact not settled after %s; retrying from their own initial guess",
            self.name,
            frame.name,
            then.name,
        )
        try:
            alone = self._near(places, places, frame, below)
        except ConvergenceError as error:
            log.info("%s", error)
            return shapes_after
        return alone if _settled(alone) else shapes_after

    def _places(self, frame: Frame, below: Mapping[str, Shapes]) -> list[Array]:
        """Each muscle's vertices (n, 3) where what surrounds it takes them in a frame."""
        bones, flesh = _neutral(below), flesh_in(below)
        return [m.places(bones, frame.bones, flesh) for m in self.muscles]

    def _near(self, start: Array, places: Array, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """The shapes of `solve`, near a start (N, 3), in surroundings at their places (N, 3)."""
        bones = _neutral(below)
        strains = [m.strains(frame.bones) for m in self.muscles]
        elastic = self.elastic.with_strains(np.concatenate(strains))
        constraints = [self._attachments(frame.bones), *self._bed(places)]
        if self.viscosity is not None:
            constraints.append(self.viscosity)
        posed = each_moved(bones, frame.bones)
        if self.contact:
            obstacles = [self._to_bones.to(name, bones[name].vertices, bone) for name, bone in posed.items()]
            free = [elastic, *constraints]
            settled = self._in_contact(free, start, obstacles, frame.name)
            if self.options.barrier:
                bodies = Bodies.of(self.muscles, self.surfaces, posed, settled.x)
                settled = kept_apart(
                    self._in_frame(bodies, free, obstacles, frame.name), settled, self.options.contacts
                )
                self._require_apart(
                    Bodies.of(self.muscles, self.surfaces, posed, settled.x), settled.x, frame
                )
            shapes = self._shapes(frame.name, settled, strains, posed, settled.figures)
            return self._with_penetration(shapes, dict(zip(posed, obstacles, strict=True)), frame.name)
        found = self._equilibrium([elastic, *constraints], start, frame.name)
        alone = Settled(found.x, 0, 0.0, solver=found.record.figures)
        return self._shapes(frame.name, alone, strains, posed, {})

    def elastic_bodies(self, bones: Mapping[str, RigidTransform]) -> dict[str, Elastic]:
        """The potential of each muscle's tets in a pose, by the name of their shape."""
        return {
            f"{m.name}_mesh": Elastic(
                m.body.mesh.vertices, m.body.mesh.tets, self.options.material, m.strains(bones)
            )
            for m in self.muscles
        }

    def contact_pressures(self, frame: Frame, shapes: Mapping[str, Shapes]) -> dict[str, dict[str, Array]]:
        """Pressure (v,) in kPa of bones and other muscles on each muscle's surface, by layer and body.

        It is that of planes of contact renewed for the equilibrium `shapes` of the frame, by layer and body.
        """
        if not self.contact:
            return {}
        bones = [Distance(bone) for bone in each_moved(_neutral(shapes), frame.bones).values()]
        posed = [m.body.surface.moved(shapes[self.name][m.name].vertices) for m in self.muscles]
        found = self.contacts.pressures(bones, posed)
        return {self.name: {m.name: each for m, each in zip(self.muscles, found, strict=True)}}

    def _attachments(self, bones: Mapping[str, RigidTransform]) -> Attachment:
        targets = np.concatenate([m.targets(bones) for m in self.muscles])
        return Attachment(self.anchors, targets, self.options.spring)

    def _bed(self, places: Array) -> list[Potential]:
        """Soft springs that stand for what is around the muscles.

        All of the muscles' surfaces that no bone holds stays near `places` (N, 3).
        """
        if self.options.bed == 0.0:
            return []
        surfaces = [(m.body.surface, m.firm) for m in self.muscles]
        areas = [np.delete(mass_lumped(s.vertices, s.triangles), firm) for s, firm in surfaces]
        stiffness = self.options.bed * np.concatenate(areas)
        return [Attachment(self.free_points, self.free_points @ places, stiffness)]

    def _in_contact(
        self,
        free: list[Potential],
        x: Array,
        obstacles: Sequence[Distance],
        frame: str,
    ) -> Settled:
        """Equilibria with the neighbours' contact planes renewed until the shapes have settled."""

        def in_place(x: Array, enough: NearEnough | None) -> Equilibrium:
            potentials = [*free, *self._contacts(obstacles, x)]
            return self._equilibrium(potentials, x, frame, enough=enough)

        name = f"{self.name} of {frame}"
        return settle(in_place, x, self.options.contacts, name, mover=self._mover, parts=self.parts)

    def _in_frame(
        self, bodies: Bodies, free: list[Potential], obstacles: Sequence[Distance], frame: str
    ) -> MusclesInFrame:
        """What the barrier needs of the muscles in a frame."""

        def planes(x: Array, margin: float | None) -> list[Potential]:
            if margin is None:
                return self.contacts.with_neighbours(x, self.surfaces, None)
            return self._contacts(obstacles, x, margin)

        def solve(contact: list[Potential], start: Array, exactly: bool) -> Equilibrium:
            return self._equilibrium([*free, *contact], start, frame, exactly)

        young, rest = float(np.max(self.options.material.young)), self.elastic.vertices
        name = f"{self.name} of {frame}"
        return MusclesInFrame(name, bodies, rest, young, self.options.contact, planes, solve)

    def _require_apart(self, bodies: Bodies, x: Array, frame: Frame) -> None:
        """Raise `ConvergenceError` where muscles behind a barrier cross, with bones near them at x (N, 3)."""
        found = bodies.crossings(x)
        if len(found.edges):
            raise no_room(f"{self.name} of {frame.name}", bodies, x, found)

    def _with_penetration(self, shapes: Shapes, bones: Mapping[str, Distance], frame: str) -> Shapes:
        """The shapes with how deep muscles lie in bones and in one another."""
        posed = []
        for muscle, held in zip(self.muscles, self._held, strict=True):
            shape = shapes[muscle.name]
            surface = Surface(shape.vertices, shape.cells)
            posed.append(Posed(muscle.name, surface, held, bool(shape.figures["cuts_itself"])))
        found = Penetration.of(posed, bones)
        if found.place:
            log.info("%s of %s: %.2f mm deep at most: %s", self.name, frame, found.depths.max(), found.place)
        return shapes | {
            m.name: replace(
                shapes[m.name], figures={**shapes[m.name].figures, "body_penetration": float(depth)}
            )
            for m, depth in zip(self.muscles, found.depths, strict=True)
        }

    @cached_property
    def _held(self) -> list[BoolArray]:
        """Of each muscle, which of its surface's vertices (v,) go with a bone."""
        return [np.isin(np.arange(len(m.body.surface.vertices)), held_vertices(m)) for m in self.muscles]

    def _mover(self, motion: Array) -> str:
        """The muscle that has the longest vector of a motion (N, 3)."""
        worst = int(np.argmax((motion**2).sum(axis=1)))
        return next(m.name for m, p in zip(self.muscles, self.parts, strict=True) if worst < p.stop)

    def _contacts(self, bones: Sequence[Distance], x: Array, margin: float = 0.0) -> list[Potential]:
        """Contact of the muscles with bones and with one another, with vertices at x (N, 3).

        margin: mm that they keep off.
        """
        with_bones = self.contacts.with_bones(bones, x, self.free_points, margin)
        return [*with_bones, *self.contacts.with_neighbours(x, self.surfaces, margin)]

    def _equilibrium(
        self,
        potentials: Sequence[Potential],
        x: Array,
        frame: str,
        exactly: bool = True,
        enough: NearEnough | None = None,
    ) -> Equilibrium:
        """The equilibrium near x (n, 3); not `exactly`: what a start of another solve needs."""
        options = equilibrium.Options(
            displacement_tolerance=STILL,
            force_tolerance=LOOSE,
            max_step=LONGEST,
            barrier=True,
            single=True,
            enough=enough,
            name=f"{self.name} of {frame}",
        )
        if not exactly:
            options = replace(options, **ROUGHLY)
        return equilibrium.solve(potentials, x, options=options)

    def _shapes(
        self,
        frame: str,
        settled: Settled,
        strains: Sequence[Array],
        bones: Mapping[str, Surface],
        figures: dict[str, float],
    ) -> Shapes:
        """Each muscle's surface with `figures`, and its tets with their validity."""
        shapes: Shapes = {}
        posed = {name: bone.vertices for name, bone in bones.items()}
        for muscle, part, strain in zip(self.muscles, self.parts, strains, strict=True):
            body, own = muscle.body, settled.x[part]
            validity = Validity.check(body.mesh.vertices, body.mesh.tets, own)
            validity.require(f"{muscle.name} of {frame}", posed)
            surface = body.surface_at(own)
            cut = cuts_itself(surface)
            if cut:
                log.warning("%s of %s folds into itself: nothing keeps it apart", muscle.name, frame)
            shapes[muscle.name] = Shape(
                body.surface.vertices,
                surface.vertices,
                surface.triangles,
                figures=figures | {"cuts_itself": float(cut)},
            )
            shapes[f"{muscle.name}_mesh"] = Shape(
                body.mesh.vertices,
                own,
                body.mesh.tets,
                {"strain": strain},
                validity.figures | settled.validity,
            )
        return shapes


def known_surfaces(muscles: Sequence[Muscle]) -> list[dict[str, Surface]]:
    """A layer's `examples`: the muscles' surfaces in each pose that they were learnt from but neutral."""
    poses = zip(*(map(m.body.surface_at, m.vertices[1:]) for m in muscles), strict=True)
    return [{m.name: s for m, s in zip(muscles, surfaces, strict=True)} for surfaces in poses]


def load(files: Sequence[Path], _: Mapping[str, Surface]) -> MuscleLayer:
    """The layer of artifacts, one a muscle."""
    muscles = [Muscle.load(file) for file in files]
    return MuscleLayer(muscles, examples=known_surfaces(muscles))


def _settled(shapes: Shapes) -> bool:
    """Whether contact has settled in every shape."""
    return not any(shape.figures.get("contact_unsettled", 0.0) for shape in shapes.values())


def _neutral(below: Mapping[str, Shapes]) -> dict[str, Surface]:
    """The neutral bones."""
    return {name: Surface(shape.rest, shape.cells) for name, shape in below["bones"].items()}
