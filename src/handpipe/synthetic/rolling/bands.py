"""Ligaments as springs without weight from bone to bone, and tendons as straight pulls of a given tension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array

TOE = 0.03  # strain at which a ligament's fibres are straight (Blankevoort et al. 1991)


@dataclass(frozen=True)
class Bands:
    """Straight bands between the bone that stays and the moving one.

    A ligament's force is 0 while slack, grows as the square of the strain up to twice `TOE`, and linearly
    beyond. Bands do not wrap around bone.

    Parameters
    ----------
    origins, insertions : array (n, 3)
        Ends on the bone that stays and on the moving bone, in the neutral frame, mm.
    slack : array (n,)
        Lengths in mm below which there is no force.
    stiffness : array (n,)
        Force in mN for a unit strain, once straight.
    tension : array (n,)
        Force in mN that does not depend on the length: a tendon's.
    """

    origins: Array
    insertions: Array
    slack: Array
    stiffness: Array
    tension: Array

    def energy(self, moved: Array) -> tuple[float, Array]:
        """Energy in microjoules with the insertions at (n, 3), and its gradient (n, 3) in mN."""
        along = moved - self.origins
        length = np.linalg.norm(along, axis=1)
        strain = np.maximum(length / self.slack - 1, 0.0)
        toe = strain < 2 * TOE
        force = self.stiffness * np.where(toe, strain**2 / (4 * TOE), strain - TOE)
        stored = np.where(toe, strain**3 / (12 * TOE), (strain - TOE) ** 2 / 2 + TOE**2 / 6)
        energy = float((self.stiffness * self.slack * stored + self.tension * length).sum())
        return energy, ((force + self.tension) / length)[:, None] * along

    def strains(self, moved: Array) -> Array:
        """Strains (n,) beyond slack with the insertions at (n, 3)."""
        return np.asarray(np.linalg.norm(moved - self.origins, axis=1) / self.slack - 1)

    def with_tension(self, tension: Array) -> Bands:
        """The same bands with other tensions (n,) in mN."""
        return Bands(self.origins, self.insertions, self.slack, self.stiffness, tension)
