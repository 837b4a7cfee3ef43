"""What the simulation of muscles is set by."""

from __future__ import annotations

from dataclasses import dataclass

from handpipe.fem.elements import Material
from handpipe.fem.solver import Limits
from handpipe.shapes.optimisation import MUSCLE


@dataclass(frozen=True)
class SimulationOptions:
    """Material, stiffnesses and contact limits of the simulation of muscles.

    Parameters
    ----------
    material : Material
        Material of the muscles.
    spring : float
        Stiffness in mN/mm of an attached point.
    bed : float
        Stiffness in mN/mm of 1 mm^2 of surface, that of 2 mm of fat.
    contact, sliding : float
        Stiffnesses in mN/mm of a point in contact, and of one that slides.
    near : float
        Distance in mm within which neighbours slide on one another.
    touch : float
        Distance in mm within which neighbours have contact planes.
    barrier : bool
        Whether a barrier keeps muscles out of bones, of one another and of themselves; else contact planes
        alone, and crossings are counted and named.
    contacts : Limits
        How often planes are renewed. A vertex that moves by more than `touch` after that may be inside a
        neighbour without a plane against it: that motion is gross.
    """

    material: Material = MUSCLE
    spring: float = 2000.0
    bed: float = 0.5
    contact: float = 500.0
    sliding: float = 4.0
    near: float = 1.0
    touch: float = 0.4
    barrier: bool = False
    contacts: Limits = Limits(renewals=20, settled=0.05, gross=0.4)
