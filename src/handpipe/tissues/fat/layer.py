"""The outermost layer: fat on all that lies below, or one soft tissue on bones; its outside is the skin."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handpipe.core import (
    LAYERS,
    Array,
    ConvergenceError,
    Frame,
    InputError,
    RigidTransform,
    Shape,
    Shapes,
    SimulatedFrame,
    artifacts,
    vertices_of,
)
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Elastic, Viscous
from handpipe.fem.solver import Settled
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh
from handpipe.skeleton.posing import LocalPoseSpaces
from handpipe.tissues.fat.bending import Origin, Pace, bent
from handpipe.tissues.fat.nails import from_vector
from handpipe.tissues.fat.resting import LOST, LoadCase, at_rest, kept_apart, penetration, pressures_at
from handpipe.tissues.fat.tissue import Tissue

log = logging.getLogger(__name__)

PACE = Pace(step=np.radians(2.5), iterations=6)  # where the tissue is bent


@dataclass(frozen=True)
class FatStrains:
    """Strains, nails and positions of the fat at N example poses.

    Parameters
    ----------
    spaces : LocalPoseSpaces
        The pose spaces in which they are interpolated.
    log_strains : array (N, m, 6)
        Logarithms of the plastic strains.
    nails : mapping of str to array (N, 6)
        Corrections of the nails: rotation vectors (rad) and shifts (mm).
    shifts : array (N, n, 3), optional
        `Tissue.shifts` in mm of the fat's equilibrium under these strains, if known. Creases can rest in
        several ways: from the blend of the bones alone an example's skin may end in another than the one its
        strains were fitted to.
    """

    spaces: LocalPoseSpaces
    log_strains: Array
    nails: Mapping[str, Array]
    shifts: Array | None = None

    def without_strains(self) -> FatStrains:
        """The same nails on fat without plastic strains (model m1 of Zheng 2022 Table 4)."""
        return replace(self, log_strains=np.zeros_like(self.log_strains), shifts=None)

    def require_mesh(self, mesh: TetMesh, source: str | Path) -> None:
        """Raise `InputError`, which names `source`, where these are not strains of a mesh."""
        found = [("log_strains", self.log_strains.shape[1], len(mesh.tets), "tets")]
        if self.shifts is not None:
            found.append(("shifts", self.shifts.shape[1], len(mesh.vertices), "vertices"))
        for name, count, wanted, of in found:
            if count != wanted:
                problem = f"are of {count} {of}, but the fat's mesh has {wanted}"
                raise InputError(source, name, problem, artifacts.REBUILD)

    def save(self, path: str | Path, inputs: Sequence[str | Path]) -> None:
        """Write as an artifact of kind "fat_strains"; nails are rotation vectors (rad) and shifts (mm)."""
        data = {"spaces": self.spaces.to_group(), "log_strains": self.log_strains, "nails": dict(self.nails)}
        units = {f"spaces/{bone}/examples": "rad" for bone in self.spaces.spaces}
        units |= {"log_strains": "1", "nails": "rad, rad, rad, mm, mm, mm"}
        if self.shifts is not None:
            data["shifts"] = self.shifts
            units["shifts"] = "mm"
        artifacts.write(path, data, kind="fat_strains", units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> FatStrains:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            Where the file is of another kind, or a number in it is not finite.
        """
        d = artifacts.read(path, "fat_strains", finite=True)
        spaces = LocalPoseSpaces.from_group(d["spaces"])
        return FatStrains(spaces, d["log_strains"], d["nails"], d.get("shifts"))


class TissueLayer(Viscous):
    """A tissue and, where fitted, its strains over poses.

    Parameters
    ----------
    name : str
        "fat" on all layers below, "skin" on bones alone.
    tissue : Tissue
        The tissue.
    strains : FatStrains, optional
        Its fitted strains and nails.
    strict : bool
        Whether a skin that cannot be kept out of itself is an error; else it is a warning, and the skin's
        figures tell.
    """

    pace = PACE

    def __init__(
        self, name: str, tissue: Tissue, strains: FatStrains | None = None, strict: bool = True
    ) -> None:
        self.name, self.tissue, self.strains, self.strict = name, tissue, strains, strict
        self.needs = LAYERS[name].needs

    def without_strains(self) -> TissueLayer:
        """The same tissue without plastic strains (model m1 of Zheng 2022 Table 4)."""
        bare = self.strains and self.strains.without_strains()
        return TissueLayer(self.name, self.tissue, bare, self.strict)

    def by_inverse_distance(self) -> TissueLayer:
        """The same tissue, its strains interpolated by the weights of Zheng 2022 Eq. 1."""
        known = self.strains and replace(self.strains, spaces=self.strains.spaces.by_inverse_distance())
        return TissueLayer(self.name, self.tissue, known, self.strict)

    def lenient(self) -> TissueLayer:
        """The same layer, not strict."""
        return TissueLayer(self.name, self.tissue, self.strains, strict=False)

    def plastic_strains(self, bones: Mapping[str, RigidTransform]) -> Array | None:
        """Strains (m, 6) of the fat in a pose, or None for none."""
        if self.strains is None:
            return None
        shares = self.tissue.weights[self.tissue.mesh.tets].mean(axis=1)
        known = self.strains
        return plasticity.exp(known.spaces.interpolate(known.log_strains, self._near(shares), bones))

    def starts(self, bones: Mapping[str, RigidTransform]) -> list[Array]:
        """Initial guesses (n, 3) of the equilibrium in a pose, best first.

        If `shifts` are known, the first guess is interpolated from them: in an example's pose it has the
        vertices at which its strains were found. The last guess is the blend of the bones.
        """
        tissue, known = self.tissue, self.strains
        blend = tissue.pose(bones)
        if known is None or known.shifts is None:
            return [blend]
        shifts = known.spaces.interpolate(known.shifts, self._near(tissue.weights), bones)
        return [tissue.pose(bones, shifts), blend]

    def _near(self, shares: Array) -> dict[str, Array]:
        """Each bone's share (k,) in places, of (k, n_bones), so that they sum to one."""
        return dict(zip(self.tissue.bones, (shares / shares.sum(axis=1, keepdims=True)).T, strict=True))

    def rigid(self, bones: Mapping[str, RigidTransform]) -> dict[str, RigidTransform]:
        """Transforms of nails and the cut end in a pose."""
        transforms = {}
        for name, part in self.tissue.rigid.items():
            correction = RigidTransform.identity()
            if self.strains is not None and name in self.strains.nails:
                vector = self.strains.spaces.spaces[part.bone].interpolate(self.strains.nails[name], bones)
                correction = from_vector(vector, self.tissue.skin.vertices[part.vertices].mean(axis=0))
            transforms[name] = bones[part.bone] @ correction
        return transforms

    def load_case(self, bones: Mapping[str, RigidTransform], below: Mapping[str, Shapes]) -> LoadCase:
        """The tissue in a pose, with its strains there, on the bodies below."""
        case = LoadCase.of(self.tissue, below, self.rigid(bones), self.plastic_strains(bones))
        return case if self.viscosity is None else replace(case, viscosity=self.viscosity)

    @property
    def bends(self) -> bool:
        """Whether the tissue can be bent in steps: its tree of bones is known, and its skin has a barrier."""
        tissue = self.tissue
        return tissue.skin_contact and bool(tissue.parents) and tissue.skin_barrier() is not None

    def bent(self, origin: Origin, frame: Frame, below: Mapping[str, Shapes]) -> Settled:
        """The equilibrium in a frame, bent from a pose in which the skin does not cross itself.

        Raises
        ------
        ConvergenceError
            Where a step fails, however small.
        """
        try:
            return bent(self.load_case, self.load_case(frame.bones, below), frame.bones, origin, self.pace)
        except ConvergenceError as error:
            raise error.within(f"{self.name} of {frame.name}") from error

    def at_rest(
        self,
        frame: Frame,
        below: Mapping[str, Shapes],
        starts: Sequence[Array],
        origin: Origin | None = None,
    ) -> Settled:
        """The equilibrium in a frame from the first good start (n, 3), its skin out of itself.

        Where the first start lies deep in itself, or no start leads there, the tissue is bent from another
        pose, by default from neutral.
        """
        tissue, case, planes = self.tissue, self.load_case(frame.bones, below), list[Settled]()

        def from_starts() -> Settled:
            planes.append(at_rest(case, starts))
            return kept_apart(case, planes[0]) if tissue.skin_contact else planes[0]

        def from_origin() -> Settled:
            return self.bent(origin or Origin.neutral(tissue, below), frame, below)

        ways = [from_starts, from_origin] if self.bends else [from_starts]
        if self.bends and tissue.overlap(starts[0]) >= LOST:
            ways.reverse()
        for way in ways:
            try:
                return way()
            except ConvergenceError as error:
                failure = error if way is from_origin else error.within(f"{self.name} of {frame.name}")
                log.info("%s", failure)
        if self.strict or not planes:
            raise failure
        log.warning("%s", failure)
        return planes[0]

    def _warn_beyond(self, frame: Frame) -> None:
        """Name the bones around which no example is near."""
        beyond = self.strains.spaces.extrapolated(frame.bones) if self.strains else []
        if beyond:
            text = "%s of %s: no example is near around %s; its strains are those of a pose nearer to them"
            log.warning(text, self.name, frame.name, ", ".join(beyond))

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """Skin surface and tissue tets at equilibrium.

        The skin's field "nail" is 1 at vertices of nails; it is missing where there are none. The skin's
        figures tell how its contact settled, how many of its vertices lie in other skin, how deep (mm), how
        near (mm) it comes to itself, and how far (mm) bones come through it. Those of the tets tell whether
        they are valid, and how deep (mm) they lie in the bodies below.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium, or tets are inverted, or the skin cannot be kept out of itself.
        """
        return self.shapes_at(self.at_rest(frame, below, self.starts(frame.bones)), frame, below)

    def solve_after(self, before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `solve`, from another frame.

        Where the other frame's skin touches itself, or would on the way, the tissue is bent from there; else
        the tissue as the bones carry it is the first guess. A viscous tissue resists its way from there.

        Raises
        ------
        ConvergenceError
            As `solve`.
        """
        origin = Origin.of(before, self.name)
        return self.moving_from(origin.x, self.tissue.elastic)._after(origin, frame, below)

    def _after(self, origin: Origin, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        tissue = self.tissue
        start = tissue.carried(origin.x, origin.bones, frame.bones)
        barrier = tissue.skin_barrier() if self.bends else None
        if barrier and (
            np.isfinite(barrier.gap(origin.x)) or barrier.max_step(origin.x, start - origin.x) < 1
        ):
            return self.shapes_at(self.bent(origin, frame, below), frame, below)
        settled = self.at_rest(frame, below, [start, *self.starts(frame.bones)], origin)
        return self.shapes_at(settled, frame, below)

    def shapes_at(self, settled: Settled, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """What `solve` hands on of an equilibrium in a frame."""
        tissue, x = self.tissue, settled.x
        self._warn_beyond(frame)
        skin, bones = tissue.skin.moved(tissue.skin_matrix @ x), below.get("bones", {})
        validity = tissue.validity(x)
        validity.require(f"{self.name} of {frame.name}", vertices_of(bones))
        figures = {**settled.figures, "skin_overlap": tissue.overlap(x), **penetration(tissue, x)}
        figures["bones_outside"] = tissue.hidden_bones.outside(skin, bones)
        return {
            "skin": Shape(tissue.skin.vertices, skin.vertices, skin.triangles, tissue.nails(), figures),
            self.name + "_mesh": Shape(
                tissue.mesh.vertices,
                x,
                tissue.mesh.tets,
                {"occupancy": tissue.occupancy},
                validity.figures | settled.validity | {"inner_overlap": tissue.inner_overlap(below, x)},
            ),
        }

    def elastic_bodies(self, bones: Mapping[str, RigidTransform]) -> dict[str, Elastic]:
        """The potential of the tissue's tets in a pose, by the name of their shape."""
        return {self.name + "_mesh": self.tissue.strained(self.plastic_strains(bones))}

    def contact_pressures(self, frame: Frame, shapes: Mapping[str, Shapes]) -> dict[str, dict[str, Array]]:
        """Contact pressures in kPa at the equilibrium `shapes` of a frame, by layer and body.

        They are those of `pressures_at`, of contact renewed for that equilibrium.
        """
        x = shapes[self.name][self.name + "_mesh"].vertices
        found = pressures_at(self.load_case(frame.bones, shapes), x)
        return {layer or self.name: pressures for layer, pressures in found.items()}


def load_fat(files: Sequence[Path], _: Mapping[str, Surface]) -> TissueLayer:
    """The fat on all layers below.

    Parameters
    ----------
    files : sequence of path
        Artifacts of its mesh and of its strains.
    _ : mapping of str to Surface
        Not used.

    Returns
    -------
    TissueLayer
        The layer "fat".

    Raises
    ------
    InputError
        For an artifact that is not valid, and for strains of another mesh.
    """
    mesh, strains = files
    tissue, known = Tissue.load(mesh), FatStrains.load(strains)
    known.require_mesh(tissue.mesh, strains)
    return TissueLayer("fat", tissue, known)
