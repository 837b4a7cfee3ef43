"""A soft tissue between inner bodies and the skin: its mesh, its material, what is known of it at rest."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from handpipe.core import (
    Array,
    InputError,
    IntArray,
    Region,
    RigidTransform,
    Shapes,
    SimulatedFrame,
    artifacts,
    without_sliding,
)
from handpipe.fem.contact import Barrier
from handpipe.fem.elements import Material, Validity, polar
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import equilibrium
from handpipe.mesh.surfaces import BodyDistances, Distance, Surface
from handpipe.mesh.tets import Embedding, TetMesh, gradient_operator, mass_lumped
from handpipe.skeleton.posing import blend, blended
from handpipe.tissues.fat.constraints import InnerPoints
from handpipe.tissues.fat.creases.materials import Creases
from handpipe.tissues.fat.hidden_bones import HiddenBones
from handpipe.tissues.fat.skin import CUT_END, Rigid
from handpipe.tissues.fat.skin_contact import BARRIER_STIFFNESS, DISTANCE, overlap, skin_barrier

log = logging.getLogger(__name__)

LARGE = 20_000  # vertices from which a factor is not kept while other layers are simulated


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

    def strained(self, strains: Array | None) -> Elastic:
        """Its elastic energy under plastic strains (m, 6), or without."""
        return self.elastic if strains is None else self.elastic.with_strains(strains)

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
    def hidden_bones(self) -> HiddenBones:
        """Bones that the neutral skin hides."""
        return HiddenBones(self.skin, self.parents)

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

    @cached_property
    def _kept(self) -> BodyDistances:
        return BodyDistances()

    def distances(self, below: Mapping[str, Shapes], chosen: IntArray) -> dict[int, Distance]:
        """Distances to those of the inner points' bodies that have an index in `chosen`, by index."""
        inner, found = self.inner, {}
        for index in np.unique(chosen):
            shape = inner.shape(below, int(index))
            name = f"{inner.layers[index]}/{inner.bodies[index]}"
            found[int(index)] = self._kept.to(name, shape.rest, Surface(shape.vertices, shape.cells))
        return found

    @cached_property
    def touching(self) -> IntArray:
        """Inner points that are in contact."""
        fixed, sliding = self.inner.region == Region.fixed, self.inner.region == Region.sliding
        return np.flatnonzero(~fixed & ~sliding)

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
        for index, distance in self.distances(below, self.inner.body).items():
            mine = points[self.inner.body == index]
            deepest = max(deepest, -float(distance.signed(mine)[0].min()))
        return deepest

    @cached_property
    def analyses(self) -> equilibrium.Analyses | None:
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
