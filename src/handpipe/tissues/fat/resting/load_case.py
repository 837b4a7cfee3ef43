"""A tissue in a frame: what acts on it there, and its equilibrium with given contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray, Region, RigidTransform, Shapes
from handpipe.fem.contact import Attachment, Contact, Sliding, SurfaceSliding
from handpipe.fem.minimisation import Equilibrium
from handpipe.fem.potentials import Elastic, Potential, Viscosity
from handpipe.fem.solver import Limits, Options, equilibrium, root_mean_square
from handpipe.mesh.surfaces import Surface, astray, touching_planes
from handpipe.tissues.fat.skin_contact import skin_on_skin
from handpipe.tissues.fat.tissue import Tissue

OPTIONS = Options(
    displacement_tolerance=1e-3,
    force_tolerance=1e-3,
    untangle=False,
    barrier=True,
    single=True,  # factors take most of the time and memory
    name="soft tissue",
)
# mm, root mean square of the skin's motion: single folds may creep on. Settled is a third of a good scan's
# noise; gross is more than the mean error of any model of the skin: its figures would say nothing.
CONTACTS = Limits(renewals=8, settled=0.01, gross=0.5)
GIVES, STIFFER = 0.2, 8.0  # mm by which contact with bones gives way; times its stiffness, added from there
HARD = ("bones", "bone_fascia")  # layers of bones


@dataclass(frozen=True)
class LoadCase:
    """A tissue in a frame.

    Parameters
    ----------
    tissue : Tissue
        The tissue.
    below : mapping of str to Shapes
        Shapes of the layers below it in the frame.
    rigid : mapping of str to RigidTransform
        Transform from neutral of each rigid part of the skin.
    elastic : Elastic
        Its elastic energy under the plastic strains of the frame.
    viscosity : Viscosity, optional
        Its viscosity over the step from the frame before; by default there is none.
    """

    tissue: Tissue
    below: Mapping[str, Shapes]
    rigid: Mapping[str, RigidTransform]
    elastic: Elastic
    viscosity: Viscosity | None = None

    @staticmethod
    def of(
        tissue: Tissue,
        below: Mapping[str, Shapes],
        rigid: Mapping[str, RigidTransform],
        strains: Array | None = None,
    ) -> LoadCase:
        """The tissue under plastic strains (m, 6), by default none."""
        return LoadCase(tissue, below, rigid, tissue.strained(strains))

    def with_strains(self, strains: Array) -> LoadCase:
        """The same case with other plastic strains (m, 6)."""
        return replace(self, elastic=self.elastic.with_strains(strains))

    def skin(self, x: Array) -> Surface:
        """The skin with the tissue at x (n, 3)."""
        return self.tissue.skin.moved(self.tissue.skin_matrix @ x)

    def skin_motion(self, motion: Array) -> float:
        """Root mean square in mm of the skin's part in a motion (n, 3) of the tissue."""
        return root_mean_square(self.tissue.skin_matrix @ motion)

    def equilibrium(
        self, contact: list[Potential], planes: Array, start: Array, options: Options = OPTIONS
    ) -> Equilibrium:
        """The equilibrium near a start (n, 3) under a contact of the skin; bodies' planes as at `planes`."""
        return equilibrium.solve(self.potentials(planes, contact=contact), start, options=options)

    def potentials(
        self, x: Array, share: float = 1.0, contact: Sequence[Potential] | None = None
    ) -> list[Potential]:
        """All that acts on the tissue; parameters as of `constraints`."""
        own = [self.elastic] if self.viscosity is None else [self.elastic, self.viscosity]
        return [*own, *self.constraints(x, share, contact)]

    def constraints(
        self, x: Array, share: float = 1.0, contact: Sequence[Potential] | None = None
    ) -> list[Potential]:
        """Constraints of the tissue at x (n, 3), with a share of their full stiffness.

        contact: of the skin with itself, by default contact planes.
        """
        unit = share * self.tissue.settings.stiffness
        return [*self.on_bodies(x, unit), *self._on_skin(x, unit, contact)]

    def on_bodies(self, x: Array, unit: float) -> list[Potential]:
        """The inner points, fixed, sliding or in contact (Zheng 2022 §6), with a stiffness in kPa/mm.

        Contact planes touch the bodies where points are closest. Sliding points slide on the surface itself:
        planes of its facets would push them back and forth. A point on the wrong side of a thin body has a
        plane on its own side. Contact with bones that has given way by 0.2 mm is nine times stiffer: else a
        stiff skin that a tight fold draws over a bone would let it through. Other bodies are soft themselves.
        """
        tissue, inner, matrix = self.tissue, self.tissue.inner, self.tissue.inner_matrix
        stiffness, touching, points = unit * inner.area, tissue.touching, matrix @ x
        fixed, sliding = inner.region == Region.fixed, inner.region == Region.sliding
        loose, sides = np.flatnonzero(~fixed), np.zeros_like(inner.normal)
        sides[loose] = tissue.sides(x, loose)
        bodies = tissue.distances(self.below, inner.body[loose])

        def planes(ids: IntArray) -> tuple[Array, Array]:
            return touching_planes(points[ids], sides[ids], inner.body[ids], bodies)

        origins, normals = planes(touching)
        hard = (tissue.creases is None) * STIFFER * np.isin(inner.layers, HARD)[inner.body[touching]]
        potentials: list[Potential] = [
            Attachment(matrix[fixed], inner.posed(self.below)[fixed], stiffness[fixed]),
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

    def _on_skin(self, x: Array, unit: float, contact: Sequence[Potential] | None) -> list[Potential]:
        """Attachments of nails and the cut end to bones, contact with bones, self-contact if it is on."""
        tissue, rest, matrix = self.tissue, self.tissue.skin.vertices, self.tissue.skin_matrix
        stiffness, skin = unit * tissue.skin_areas, self.skin(x)
        parts: list[Potential] = [
            Attachment(matrix[part.vertices], self.rigid[name](rest[part.vertices]), stiffness[part.vertices])
            for name, part in tissue.rigid.items()
        ]
        parts += self.bones_on_skin(skin, matrix, unit)
        if contact is not None:
            return [*parts, *contact]
        if not tissue.skin_contact:
            return parts
        return [*parts, *skin_on_skin(tissue.skin, skin, matrix, stiffness)]

    def bones_on_skin(self, skin: Surface, matrix: sparse.csr_matrix, unit: float) -> list[Contact]:
        """Contact of the skin, as it is now, with bones beneath it.

        matrix: (v, n) takes unknowns to the skin's vertices; unit: stiffness in kPa/mm of all contact.
        """
        bones = self.below.get("bones", {})
        return list(self.tissue.hidden_bones.contact(skin, bones, matrix, (1 + STIFFER) * unit))
