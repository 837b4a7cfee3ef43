"""A soft tissue between inner bodies and the skin: its mesh, its constraints, its equilibrium in a frame."""

from __future__ import annotations

import copy
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from handpipe.core import (
    Array,
    ConvergenceError,
    InputError,
    IntArray,
    Region,
    RigidTransform,
    Shapes,
    SimulatedFrame,
    artifacts,
    without_sliding,
)
from handpipe.fem.contact import Attachment, Barrier, Contact, Sliding, SurfaceSliding, contact_pressures
from handpipe.fem.elements import Material, Validity, polar
from handpipe.fem.minimisation import Equilibrium, Record
from handpipe.fem.potentials import Elastic, Potential, Viscosity
from handpipe.fem.solver import Limits, NearEnough, Options, Settled, equilibrium, root_mean_square, settle
from handpipe.mesh.surfaces import BodyDistances, Distance, Surface, astray, touching_planes
from handpipe.mesh.tets import Embedding, TetMesh, gradient_operator, mass_lumped
from handpipe.skeleton.posing import blend, blended
from handpipe.tissues.fat.constraints import InnerPoints
from handpipe.tissues.fat.creases.materials import Creases
from handpipe.tissues.fat.skin import CUT_END, Rigid
from handpipe.tissues.fat.skin_contact import BARRIER_STIFFNESS, DISTANCE, overlap, skin_barrier, skin_on_skin

log = logging.getLogger(__name__)

OPTIONS = Options(
    displacement_tolerance=1e-3,
    force_tolerance=1e-3,
    untangle=False,
    barrier=True,
    single=True,  # factors take most of the time and memory
    name="soft tissue",
)
LARGE = 20_000  # vertices from which a factor is not kept while other layers are simulated
# mm, root mean square of the skin's motion: single folds may creep on. Settled is a third of a good scan's
# noise; gross is more than the mean error of any model of the skin: its figures would say nothing.
CONTACTS = Limits(renewals=8, settled=0.01, gross=0.5)
CROWDED = 0.5  # mm of the skin's self-penetration, at the start or the end, from which tissue is shrunk
LOST = 3.0  # mm of a further start's self-penetration, from which it leads where the first one led
SIZES = (0.75, 0.9)  # relative sizes of the shrunk tissue, in turn; at 0.6 thin places are crushed
GIVES, STIFFER = 0.2, 8.0  # mm by which contact with bones gives way; times its stiffness, added from there
HARD = ("bones", "bone_fascia")  # layers of bones
SOFTEST = 1e-3  # of the constraints' stiffness, where they stiffen in steps


@dataclass(frozen=True)
class TissueSettings:
    """Material of the fat and of the skin around it, and stiffness of the fat's constraints.

    Parameters
    ----------
    young : float
        Young's modulus in kPa.
    poisson : float
        Poisson's ratio.
    stiffness : float
        Stiffness of the constraints in kPa/mm, per area they act on.
    skin_young : float
        Young's modulus of the skin in kPa; it counts where a tissue has a `skin_share`.

    References
    ----------
    Zheng 2022 Table 2: fat 1 kPa. The skin's modulus was chosen on validation subjects (docs/methods.md).
    """

    young: float = 1.0
    poisson: float = 0.48
    stiffness: float = 50.0
    skin_young: float = 20.0


@dataclass(frozen=True)
class Tissue:
    """A soft tissue between inner bodies and the skin.

    Parameters
    ----------
    mesh : TetMesh
        Neutral tets: n vertices in mm, m tets.
    occupancy : array (m,)
        Share of each tet that is tissue; it scales the tet's stiffness.
    skin : Surface
        Neutral skin in mm, embedded in the mesh.
    inner : InnerPoints
        Points of inner bodies that constrain the tissue.
    rigid : mapping of str to Rigid
        Rigid parts of the skin, by name.
    bones : tuple of str
        Bones that the columns of `weights` belong to.
    weights : array (n, n_bones)
        Weights of the bones at each vertex.
    settings : TissueSettings
        Material and stiffness of constraints.
    skin_contact : bool
        Whether contact keeps the skin out of itself.
    creases : Creases, optional
        Materials of single tets; by default the material is that of the settings.
    skin_share : array (m,), optional
        Share of each tet's tissue that is skin; by default none is.
    parents : mapping of str to str
        Parent of each bone but the root, parents before children: the way into poses. Without it the tissue
        cannot be bent in steps.
    viscosity : Viscosity, optional
        Viscosity over the step from the frame before; by default there is none.
    """

    mesh: TetMesh
    occupancy: Array
    skin: Surface
    inner: InnerPoints
    rigid: Mapping[str, Rigid]
    bones: tuple[str, ...]
    weights: Array
    settings: TissueSettings = field(default_factory=TissueSettings)
    skin_contact: bool = True
    creases: Creases | None = None
    skin_share: Array | None = None
    parents: Mapping[str, str] = field(default_factory=dict)
    viscosity: Viscosity | None = None

    def viscous(self, x: Array, ratio: float) -> Tissue:
        """The same tissue as it moves from x (n, 3): `ratio` is its retardation time over the step's length.

        What has been found of this tissue is kept for the other.
        """
        for name, member in vars(Tissue).items():
            if isinstance(member, cached_property):
                getattr(self, name)
        other = copy.copy(self)
        object.__setattr__(other, "viscosity", Viscosity(self.elastic, x, ratio))
        return other

    def without_sliding(self) -> Tissue:
        """The same tissue, fixed where it slides on the bodies below."""
        return replace(self, inner=replace(self.inner, region=without_sliding(self.inner.region)))

    @cached_property
    def elastic(self) -> Elastic:
        """Elastic energy without plastic strain, stiffness weighed by occupancy.

        A tet that is partly skin is as stiff as skin and fat side by side: what counts is how both are
        stretched along the surface.
        """
        young: float | Array = self.settings.young
        if self.skin_share is not None:
            young = young + self.skin_share * (self.settings.skin_young - young)
        uniform = Material(young, self.settings.poisson)
        material = uniform if self.creases is None else self.creases.material
        return Elastic(self.mesh.vertices, self.mesh.tets, material, weights=self.occupancy)

    def nails(self) -> dict[str, NDArray[np.uint8]]:
        """Field "nail" (k,) of the skin, 1 at vertices of nails; nothing where there are none."""
        parts = [p.vertices for name, p in self.rigid.items() if not name.startswith(CUT_END)]
        if not parts:
            return {}
        return {"nail": np.isin(np.arange(len(self.skin.vertices)), np.concatenate(parts)).astype(np.uint8)}

    @cached_property
    def skin_matrix(self) -> sparse.csr_matrix:
        """Skin vertices (k, n) as sums of tissue vertices."""
        return self._skin_embedding.matrix(len(self.mesh.vertices))

    @cached_property
    def skin_operator(self) -> sparse.csr_matrix:
        """Flattened positions of skin vertices (3 k, 3 n) from those of tissue vertices."""
        return self._skin_embedding.matrix3(len(self.mesh.vertices))

    @cached_property
    def _skin_embedding(self) -> Embedding:
        return Embedding.embed(self.skin.vertices, self.mesh)

    @cached_property
    def inner_matrix(self) -> sparse.csr_matrix:
        """Inner points (k, n) as sums of tissue vertices."""
        return self._inner_embedding.matrix(len(self.mesh.vertices))

    @cached_property
    def _inner_embedding(self) -> Embedding:
        return Embedding.embed(self.inner.rest, self.mesh)

    @cached_property
    def _around_inner(self) -> sparse.csr_matrix:
        """As `inner_matrix`, without negative weights: those of a point outside its tet may reverse a sum."""
        return self._inner_embedding.drawn_in().matrix(len(self.mesh.vertices))

    def pose(self, bones: Mapping[str, RigidTransform], shifts: Array | float = 0.0) -> Array:
        """Vertices (n, 3), shifted by (n, 3) and moved by smooth blends of bone transforms.

        They are a start for the solver.
        """
        return blend(self.mesh.vertices + shifts, self.weights, {b: bones[b] for b in self.bones})

    def shifts(self, bones: Mapping[str, RigidTransform], x: Array) -> Array:
        """Shifts (n, 3) with which `pose` gives the vertices x (n, 3)."""
        turns, translation = blended(self.weights, {b: bones[b] for b in self.bones})
        return turns.inv().apply(x - translation) - self.mesh.vertices

    def after(self, name: str, before: SimulatedFrame, bones: Mapping[str, RigidTransform]) -> Array:
        """Vertices (n, 3) of the layer of a name in another frame, carried by the bones to this pose."""
        frame, shapes = before
        return self.carried(shapes[name][f"{name}_mesh"].vertices, frame.bones, bones)

    def carried(
        self, x: Array, bones: Mapping[str, RigidTransform], others: Mapping[str, RigidTransform]
    ) -> Array:
        """Vertices (n, 3) of a pose of the bones, carried by them to another pose."""
        return self.pose(others, self.shifts(bones, x))

    def skin_barrier(self) -> Barrier | None:
        """A fresh barrier of the skin against itself; None where the neutral skin intersects itself."""
        known = self._neutral_barrier
        return None if known is None else known.reaching(DISTANCE)

    @cached_property
    def _neutral_barrier(self) -> Barrier | None:
        try:
            return skin_barrier(
                self.mesh.vertices, self.skin.triangles, self.skin_matrix, self.barrier_stiffness
            )
        except InputError:
            log.warning("soft tissue: the neutral skin intersects itself; no barrier keeps it out of itself")
            return None

    @property
    def barrier_stiffness(self) -> float:
        """Stiffness in kPa of the skin's barrier: pressed sheets keep some hundredths of a mm."""
        stiff = 0.0 if self.skin_share is None else self.settings.skin_young
        return max(BARRIER_STIFFNESS * self.settings.young, stiff)

    @cached_property
    def skin_areas(self) -> Array:
        """Neutral area (k,) in mm^2 that belongs to each skin vertex."""
        return mass_lumped(self.skin.vertices, self.skin.triangles)

    @cached_property
    def _gradients(self) -> sparse.csr_matrix:
        """Matrix (9 m, 3 n) from positions to deformation gradients."""
        return gradient_operator(self.mesh.vertices, self.mesh.tets)

    @cached_property
    def _around(self) -> sparse.csr_matrix:
        """Matrix (n, m) that sums over the tets around each vertex, by their volumes."""
        tets = self.mesh.tets
        corners = np.repeat(np.arange(len(tets)), 4)
        return sparse.csr_matrix(
            (np.repeat(self.mesh.volumes(), 4), (tets.ravel(), corners)),
            shape=(len(self.mesh.vertices), len(tets)),
        )

    def sides(self, x: Array, ids: IntArray) -> Array:
        """Neutral outward normals (c, 3) of the bodies at some inner points, turned as the tissue is.

        ids: indices (c,) of the points; the tissue has its vertices at x (n, 3).

        Rotations come from deformation gradients averaged around each vertex: no single crushed tet upsets
        them.
        """
        gradients = (self._gradients @ x.ravel()).reshape(-1, 9)
        rotations, _ = polar((self._around_inner[ids] @ (self._around @ gradients)).reshape(-1, 3, 3))
        return np.einsum("nij,nj->ni", rotations, self.inner.normal[ids])

    def constraints(
        self,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        x: Array,
        share: float = 1.0,
        contact: Sequence[Potential] | None = None,
    ) -> list[Potential]:
        """Constraints of the tissue in a frame, at x (n, 3), with a share of their full stiffness; viscosity.

        rigid: transform from neutral of each rigid part of the skin; contact: of the skin with itself, by
        default contact planes.
        """
        unit = share * self.settings.stiffness
        resisting = [] if self.viscosity is None else [self.viscosity]
        return [*resisting, *self._on_bodies(below, x, unit), *self._on_skin(rigid, x, unit, contact)]

    def _on_bodies(self, below: Mapping[str, Shapes], x: Array, unit: float) -> list[Potential]:
        """The inner points, fixed, sliding or in contact (Zheng 2022 §6).

        Contact planes touch the bodies where points are closest. Sliding points slide on the surface itself:
        planes of its facets would push them back and forth. A point on the wrong side of a thin body has a
        plane on its own side. Contact with bones that has given way by 0.2 mm is nine times stiffer: else a
        stiff skin that a tight fold draws over a bone would let it through. Other bodies are soft themselves.
        """
        inner, matrix, stiffness = self.inner, self.inner_matrix, unit * self.inner.area
        fixed, sliding = inner.region == Region.fixed, inner.region == Region.sliding
        touching, points, sides = self._touching, matrix @ x, np.zeros_like(inner.normal)
        loose = np.flatnonzero(~fixed)
        sides[loose] = self.sides(x, loose)
        bodies = self._distances(below, inner.body[loose])

        def planes(ids: IntArray) -> tuple[Array, Array]:
            return touching_planes(points[ids], sides[ids], inner.body[ids], bodies)

        origins, normals = planes(touching)
        hard = (self.creases is None) * STIFFER * np.isin(inner.layers, HARD)[inner.body[touching]]
        potentials: list[Potential] = [
            Attachment(matrix[fixed], inner.posed(below)[fixed], stiffness[fixed]),
            Contact(matrix[touching], origins, normals, stiffness[touching]),
            Contact(matrix[touching], origins - GIVES * normals, normals, hard * stiffness[touching]),
        ]
        on_surfaces: list[SurfaceSliding] = []
        for body in np.unique(inner.body[sliding]):
            ids = np.flatnonzero(sliding & (inner.body == body))
            signed, _, _, facing = bodies[int(body)].signed(points[ids])
            lost = astray(signed, facing, sides[ids])
            on, off = ids[~lost], ids[lost]
            on_surfaces.append(SurfaceSliding(matrix[on], bodies[int(body)], stiffness[on]))
            if len(off):
                potentials.append(Sliding(matrix[off], *planes(off), stiffness[off]))
        return [*potentials, *SurfaceSliding.stacked(on_surfaces)]

    def _on_skin(
        self,
        rigid: Mapping[str, RigidTransform],
        x: Array,
        unit: float,
        contact: Sequence[Potential] | None,
    ) -> list[Potential]:
        """Attachments of nails and the cut end to their bones, and the skin's self-contact if it is on."""
        skin, matrix = self.skin, self.skin_matrix
        stiffness = unit * self.skin_areas
        parts: list[Potential] = [
            Attachment(
                matrix[part.vertices], rigid[name](skin.vertices[part.vertices]), stiffness[part.vertices]
            )
            for name, part in self.rigid.items()
        ]
        if contact is not None:
            return [*parts, *contact]
        if not self.skin_contact:
            return parts
        return [*parts, *skin_on_skin(skin, skin.moved(matrix @ x), matrix, stiffness)]

    @cached_property
    def _kept(self) -> BodyDistances:
        return BodyDistances()

    def _distances(self, below: Mapping[str, Shapes], chosen: IntArray) -> dict[int, Distance]:
        """Distances to those of the inner points' bodies that have an index in `chosen`, by index."""
        inner, found = self.inner, {}
        for index in np.unique(chosen):
            shape = inner.shape(below, int(index))
            name = f"{inner.layers[index]}/{inner.bodies[index]}"
            found[int(index)] = self._kept.to(name, shape.rest, Surface(shape.vertices, shape.cells))
        return found

    @cached_property
    def _touching(self) -> IntArray:
        """Inner points that are in contact."""
        fixed, sliding = self.inner.region == Region.fixed, self.inner.region == Region.sliding
        return np.flatnonzero(~fixed & ~sliding)

    def contact_pressures(self, below: Mapping[str, Shapes], x: Array) -> dict[str, dict[str, Array]]:
        """Contact pressures in kPa with the tissue at x (n, 3), by layer and body; the skin's layer is "".

        That of the skin on itself is by skin vertex (k,), that of the tissue on a body below by its vertex;
        the latter is zero where the tissue is fixed or slides.
        """
        return {"": {"skin": self._pressures_on_skin(x)}, **self._pressures_on_bodies(below, x)}

    def _pressures_on_skin(self, x: Array) -> Array:
        """Pressure (k,) of the skin on itself: the barrier's, or the planes' where it crosses itself."""
        skin, barrier = self.skin.moved(self.skin_matrix @ x), self.skin_barrier()
        if barrier is not None and not barrier.intersects(x):
            areas = mass_lumped(skin.vertices, skin.triangles)
            return -np.einsum("ni,ni->n", barrier.surface_forces(x), skin.vertex_normals()) / areas
        area = self.skin_areas
        identity = sparse.identity(len(area), format="csr")
        return contact_pressures(
            skin_on_skin(self.skin, skin, identity, self.settings.stiffness * area), skin
        )

    def _pressures_on_bodies(self, below: Mapping[str, Shapes], x: Array) -> dict[str, dict[str, Array]]:
        """Pressure (v,) of the tissue on the bodies that it touches, over their vertices' posed areas."""
        inner, ids = self.inner, self._touching
        contacts = [c for c in self._on_bodies(below, x, self.settings.stiffness) if isinstance(c, Contact)]
        forces = [np.linalg.norm(c.forces(c.points(x)), axis=1) for c in contacts]
        force = np.zeros(len(inner.rest))
        force[ids] = np.sum(forces, axis=0)
        found: dict[str, dict[str, Array]] = {}
        for body, surface in enumerate(inner.surfaces(below)):
            mine = ids[inner.body[ids] == body]
            if len(mine):
                total = np.zeros(len(surface.vertices))
                np.add.at(total, inner.vertex[mine], force[mine])
                pressure = total / mass_lumped(surface.vertices, surface.triangles)
                found.setdefault(inner.layers[body], {})[inner.bodies[body]] = pressure
        return found

    def overlap(self, x: Array) -> float:
        """Depth in mm, at most, of the skin in itself with the tissue at x (n, 3)."""
        known = self._overlaps.get("last")
        if known is None or not np.array_equal(known[0], x):
            known = x.copy(), overlap(self.skin, self.skin.moved(self.skin_matrix @ x))
            self._overlaps["last"] = known
        return known[1]

    @cached_property
    def _overlaps(self) -> dict[str, tuple[Array, float]]:
        """The last positions for which `overlap` was asked, and its answer: it is asked more than once."""
        return {}

    def inner_overlap(self, below: Mapping[str, Shapes], x: Array) -> float:
        """Depth in mm, at most, of the tissue's inner points in their bodies, with the tissue at x (n, 3)."""
        points, deepest = self.inner_matrix @ x, 0.0
        for index, distance in self._distances(below, self.inner.body).items():
            mine = points[self.inner.body == index]
            deepest = max(deepest, -float(distance.signed(mine)[0].min()))
        return deepest

    def opened(
        self,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        strains: Array | None,
        x: Array,
        anyway: bool = False,
    ) -> Array:
        """A start (n, 3) with open creases, from x (n, 3).

        The tissue is shrunk, draws back from the creases, and grows again. Skin deep in other skin needs this
        room to come out. Arguments are those of `solve`. The result is x itself where its skin hardly
        penetrates itself, unless `anyway` says otherwise. A size without an equilibrium is skipped.
        """
        if not anyway and self.overlap(x) < CROWDED:
            return x
        whole = self.elastic.strains if strains is None else strains
        for size in SIZES:
            try:
                x = self._solve(self.elastic.with_strains(size * whole), below, rigid, x).x
            except ConvergenceError as error:
                log.warning("soft tissue: no equilibrium at %.2f of its size: %s", size, error)
            else:
                log.info(
                    "soft tissue: at %.2f of its size, skin self-penetration %.2f mm", size, self.overlap(x)
                )
        return x

    def at_rest(
        self,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        strains: Array | None,
        starts: Sequence[Array],
    ) -> Settled:
        """The equilibrium of `solve` from the first start (n, 3) that ends without self-penetration.

        Self-penetration is that of the skin. Starts are tried in turn, by way of smaller sizes where their
        skin lies in itself. A start whose skin did not is tried again by way of smaller sizes if the
        equilibrium's skin does. Where every equilibrium has self-penetration, the one with the least is
        taken. Once there is an equilibrium, starts with skin 3 mm or more in itself are not tried: their
        bodies leave no room, and that is the pose's fault.

        Raises
        ------
        ConvergenceError
            The last one, where no start led to an equilibrium.
        """
        found: list[Settled] = []
        failure: ConvergenceError | None = None
        for way in self._ways(below, rigid, strains, self._worth_trying(starts, found)):
            if found:
                log.info(
                    "soft tissue: skin self-penetration %.2f mm; retrying from the next start",
                    self.overlap(found[-1].x),
                )
            try:
                found.append(self.solve(below, rigid, strains, way))
            except ConvergenceError as error:
                log.warning("soft tissue: %s", error)
                failure = error
            else:
                if self.overlap(found[-1].x) < CROWDED:
                    return found[-1]
        if not found and failure is not None:
            raise failure
        return min(found, key=lambda settled: self.overlap(settled.x))

    def _worth_trying(self, starts: Iterable[Array], found: Sequence[Settled]) -> Iterator[Array]:
        """Starts (n, 3), without those deep in themselves once something is found."""
        for start in starts:
            if found and (depth := self.overlap(start)) >= LOST:
                log.info("soft tissue: a start with skin %.2f mm in itself is not tried", depth)
                continue
            yield start

    def _ways(
        self,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        strains: Array | None,
        starts: Iterable[Array],
    ) -> Iterator[Array]:
        """Initial guesses (n, 3): each start, opened if it has to be, then opened anyway."""
        for start in starts:
            opened = self.opened(below, rigid, strains, start)
            yield opened
            if opened is start:
                yield self.opened(below, rigid, strains, start, anyway=True)

    def solve(
        self,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        strains: Array | None,
        start: Array,
        contacts: Limits = CONTACTS,
    ) -> Settled:
        """Vertices (n, 3) at equilibrium under plastic strains (m, 6), from a start (n, 3).

        Contact planes are renewed until the skin has settled.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium, or the skin does not come to rest.
        """
        elastic = self.elastic if strains is None else self.elastic.with_strains(strains)
        records: list[Record] = []

        def in_place(x: Array, enough: NearEnough | None) -> Array:
            found = self._solve(elastic, below, rigid, x, enough)
            records.append(found.record)
            return found.x

        def skin_motion(motion: Array) -> float:
            return root_mean_square(self.skin_matrix @ motion)

        settled = settle(in_place, start, contacts, "soft tissue", skin_motion)
        return replace(settled, solver=records[settled.chosen - 1].figures)

    def _solve(
        self,
        elastic: Elastic,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        start: Array,
        enough: NearEnough | None = None,
    ) -> Equilibrium:
        options = replace(OPTIONS, enough=enough)
        try:
            potentials = [elastic, *self.constraints(below, rigid, start)]
            return equilibrium.solve(potentials, start, options=options, analyses=self._analyses)
        except ConvergenceError as error:
            log.info("%s; retrying with constraints that stiffen in steps", error)

        def softened(t: float) -> list[Potential]:
            return [elastic, *self.constraints(below, rigid, start, SOFTEST ** (1 - t))]

        return equilibrium.continuation(softened, start, options=OPTIONS)

    @cached_property
    def _analyses(self) -> equilibrium.Analyses | None:
        """Analyses of linear systems for all frames; the factors of large meshes take too much memory."""
        return equilibrium.Analyses() if len(self.mesh.vertices) < LARGE else None

    def validity(self, x: Array) -> Validity:
        """Whether the tissue is valid at x (n, 3)."""
        return Validity.check(self.mesh.vertices, self.mesh.tets, x)

    def save(self, path: str | Path, inputs: Sequence[str | Path]) -> None:
        """Write as an artifact of kind "tissue"."""
        data = {
            "mesh": {"vertices": self.mesh.vertices, "tets": self.mesh.tets},
            "occupancy": self.occupancy,
            "skin": {"vertices": self.skin.vertices, "triangles": self.skin.triangles},
            "inner": self.inner.to_group(),
            "rigid": {name: asdict(part) for name, part in self.rigid.items()},
            "bones": list(self.bones),
            "weights": self.weights,
            "settings": asdict(self.settings),
        }
        lengths = dict.fromkeys(("mesh/vertices", "skin/vertices", "inner/rest"), "mm")
        moduli = {"settings/young": "kPa", "settings/skin_young": "kPa", "settings/stiffness": "kPa/mm"}
        units = lengths | moduli | {"inner/area": "mm^2", "occupancy": "1", "weights": "1"}
        if self.skin_share is not None:
            data["skin_share"], units["skin_share"] = self.skin_share, "1"
        if self.creases is not None:
            data["creases"] = self.creases.to_group()
            units |= {"creases/young": "kPa", "creases/poisson": "1"}
        if self.parents:
            data["joints"] = {"children": list(self.parents), "parents": list(self.parents.values())}
        artifacts.write(path, data, kind="tissue", units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Tissue:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            Where the file is not a tissue, or a mesh or number in it is not valid.
        """
        d = artifacts.read(path, "tissue", finite=True)
        given, count = d.get("creases"), len(d["mesh"]["tets"])
        joints = d.get("joints", {"children": (), "parents": ()})
        return Tissue(
            mesh=TetMesh(d["mesh"]["vertices"], d["mesh"]["tets"]).checked(path),
            occupancy=d["occupancy"],
            skin=Surface(d["skin"]["vertices"], d["skin"]["triangles"]).checked(path),
            inner=InnerPoints.from_group(d["inner"]),
            rigid={name: Rigid(str(part["bone"]), part["vertices"]) for name, part in d["rigid"].items()},
            bones=tuple(d["bones"]),
            weights=d["weights"],
            settings=TissueSettings(**{k: float(v) for k, v in d["settings"].items()}),
            creases=None if given is None else Creases.from_group(given, path, count),
            skin_share=d.get("skin_share"),
            parents=dict(zip(joints["children"], joints["parents"], strict=True)),
        )
