"""A fascia: a shrunk cloth around bodies, with fixed, sliding and contact vertices (Zheng 2022 §6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, IntArray, Region, artifacts
from handpipe.fem.contact import SurfaceContact, SurfaceSliding
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Membrane, Potential
from handpipe.fem.solver import Options, equilibrium
from handpipe.mesh.contact import distance_to
from handpipe.mesh.surfaces import Anchors, BodyDistances, Distance, Surface, same_values
from handpipe.mesh.tets import mass_lumped
from handpipe.tissues.fascia.regions import slender

THICKNESS = 1.0  # mm, of the membrane that `young` belongs to
SLENDER = 2.0  # mm, radius of a body around which cloth with edges of 1.5 mm slips off
STILL, LOOSE = 5e-3, 1e-2  # mm and 1: tolerances of moves and forces


@dataclass(frozen=True)
class ClothSettings:
    """Material of the fascia.

    Parameters
    ----------
    young : float
        Young's modulus in kPa of a membrane 1 mm thick.
    poisson : float
        Poisson's ratio.
    shrink : float
        Rest size over true size.
    stiffness : float
        Stiffness of sliding and contact in kPa/mm, far above the cloth's own.

    References
    ----------
    Zheng 2022 Table 2.
    """

    young: float = 0.1
    poisson: float = 0.48
    shrink: float = 0.35
    stiffness: float = 60.0


@dataclass(frozen=True)
class Fascia:
    """A cloth around bodies: its neutral surface, and how each vertex is constrained.

    Parameters
    ----------
    name : str
        Name of the layer.
    surface : Surface
        Neutral surface in mm, n vertices.
    regions : array (n,)
        `Region` of each vertex: fixed, sliding or contact.
    owners : array (n,)
        Index into `bodies` of the body that carries each vertex.
    tied : array (n,) of bool
        Vertices that are fixed to their body although the tissue around may slide on it. They are where a
        body is slender: the cloth's tension would pull the few vertices around it off over its side.
    bodies : tuple of str
        Names of the bodies.
    settings : ClothSettings
        Material.
    """

    name: str
    surface: Surface
    regions: IntArray
    owners: IntArray
    tied: BoolArray
    bodies: tuple[str, ...]
    settings: ClothSettings = field(default_factory=ClothSettings)

    @staticmethod
    def around(
        name: str, surface: Surface, regions: IntArray, bodies: Mapping[str, Surface], settings: ClothSettings
    ) -> Fascia:
        """Each vertex is carried by the body that is nearest in neutral."""
        distances = np.stack([Distance(b).closest(surface.vertices)[0] for b in bodies.values()])
        owners = distances.argmin(axis=0)
        slid_on = np.isin(owners, owners[regions == Region.sliding])
        tied = (regions != Region.fixed) & slid_on & slender(surface.vertices, bodies, SLENDER)
        return Fascia(name, surface, regions, owners, tied, tuple(bodies), settings)

    def carried(self, rest: Mapping[str, Surface], posed: Mapping[str, Surface]) -> Array:
        """Each vertex (n, 3) as its body carries it."""
        points = np.empty_like(self.surface.vertices)
        for index, body in enumerate(self.bodies):
            mine = self.owners == index
            if mine.any():
                points[mine] = self._anchored(body, mine, rest[body])(posed[body].vertices)
        return points

    def _anchored(self, body: str, mine: BoolArray, rest: Surface) -> Anchors:
        """Vertices `mine` (n,) anchored on a body at rest; the anchors are kept for the next pose."""
        known = self._anchors.get(body)
        if known is None or not same_values(known[0], rest.vertices):
            known = rest.vertices, Anchors.attach(self.surface.vertices[mine], rest)
            self._anchors[body] = known
        return known[1]

    @cached_property
    def _anchors(self) -> dict[str, tuple[Array, Anchors]]:
        """Anchors by body, with the neutral vertices of the body that they belong to."""
        return {}

    @cached_property
    def _distances(self) -> BodyDistances:
        return BodyDistances(distance_to)

    def solve(self, rest: Mapping[str, Surface], posed: Mapping[str, Surface], start: Array) -> Array:
        """Equilibrium (n, 3) of the shrunk cloth over posed bodies, from a start (n, 3)."""
        settings, drawn = self.settings, self.surface
        carried = self.carried(rest, posed)
        stiffness = settings.stiffness * mass_lumped(drawn.vertices, drawn.triangles)
        fixed = self.tied | (self.regions == Region.fixed)
        sliding = ~fixed & (self.regions == Region.sliding)
        identity = sparse.identity(len(start), format="csr")
        material = Material(settings.young, settings.poisson)
        potentials: list[Potential] = [
            Membrane(drawn.vertices, drawn.triangles, material, THICKNESS, settings.shrink),
        ]
        contacts, slidings = [], []
        for index, body in enumerate(self.bodies):
            distance = self._distances.to(body, rest[body].vertices, posed[body])
            slides = sliding & (self.owners == index)
            touches = ~fixed & ~slides
            contacts.append(SurfaceContact(identity[touches], distance, stiffness[touches]))
            if slides.any():
                slidings.append(SurfaceSliding(identity[slides], distance, stiffness[slides]))
        potentials += [*SurfaceContact.stacked(contacts), *SurfaceSliding.stacked(slidings)]
        start = np.where((fixed | sliding)[:, None], carried, start)
        # A vertex may rest on an edge between facets, where the force jumps: residuals cannot vanish there.
        options = Options(displacement_tolerance=STILL, force_tolerance=LOOSE, name=self.name)
        pinned = np.repeat(fixed[:, None], 3, axis=1)
        return equilibrium.solve(potentials, start, fixed=pinned, options=options).x

    def save(self, path: str | Path, inputs: Sequence[str | Path]) -> None:
        """Write as an artifact of kind "fascia"."""
        data = {
            "name": self.name,
            "surface": {"vertices": self.surface.vertices, "triangles": self.surface.triangles},
            "regions": self.regions,
            "owners": self.owners,
            "tied": self.tied,
            "bodies": list(self.bodies),
            "settings": vars(self.settings),
        }
        artifacts.write(path, data, kind="fascia", units={"surface/vertices": "mm"}, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Fascia:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            Where the file is of another kind, or its surface is not valid.
        """
        d = artifacts.read(path, "fascia", finite=True)
        surface = Surface(d["surface"]["vertices"], d["surface"]["triangles"]).checked(path)
        settings = ClothSettings(**{k: float(v) for k, v in d["settings"].items()})
        return Fascia(
            str(d["name"]), surface, d["regions"], d["owners"], d["tied"], tuple(d["bodies"]), settings
        )
