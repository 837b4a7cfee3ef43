"""Whether a deformed tet mesh is valid: the determinants of its deformation gradients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, ConvergenceError, IntArray

REMEDY = "Move less from the scanned poses, or refine the mesh there."


@dataclass(frozen=True)
class Validity:
    """Inverted tets of a deformed mesh and its least det F.

    Parameters
    ----------
    tets : int
        Number of tets.
    inverted : int
        Number of tets with det F of zero or less, or not finite.
    least : float
        Least det F; minus infinity if one is not finite.
    place : array (3,)
        Centre of the tet with the least det F in mm.
    """

    tets: int
    inverted: int
    least: float
    place: Array

    @staticmethod
    def check(rest: Array, tets: IntArray, x: Array) -> Validity:
        """Of tets (m, 4) at x (n, 3) whose vertices are at `rest` (n, 3) undeformed."""
        ratios = volumes(x, tets) / volumes(rest, tets)
        ratios = np.where(np.isfinite(ratios), ratios, -np.inf)
        worst = int(np.argmin(ratios))
        place = x[tets[worst]].mean(axis=0)
        return Validity(len(tets), int((ratios <= 0).sum()), float(ratios[worst]), place)

    @property
    def figures(self) -> dict[str, float]:
        """What an artifact keeps of it, by name."""
        return {"inverted_tets": float(self.inverted), "least_det": self.least}

    def __str__(self) -> str:
        """One line: the count of inverted tets, and the place and det F of the worst tet."""
        at = ", ".join(f"{c:.1f}" for c in self.place)
        worst = f"the worst at ({at}) mm has det F = {self.least:.2g}"
        return f"{self.inverted} of {self.tets} tets are inverted, {worst}"

    def require(self, body: str, bones: Mapping[str, Array] | None = None) -> None:
        """Raise `ConvergenceError` with the place if a tet is inverted; bones: vertices (k, 3) by name."""
        if self.inverted == 0:
            return
        raise ConvergenceError(body, f"{self}{self._beside(bones or {})}", REMEDY)

    def _beside(self, bones: Mapping[str, Array]) -> str:
        distances = {name: float(cKDTree(v).query(self.place)[0]) for name, v in bones.items()}
        if not distances:
            return ""
        nearest = min(distances, key=lambda name: distances[name])
        return f", {distances[nearest]:.1f} mm from {nearest}"


def volumes(x: Array, tets: IntArray) -> Array:
    """Signed volumes (m,) of tets (m, 4) in mm^3."""
    a, b, c = (x[tets[:, i]] - x[tets[:, 0]] for i in (1, 2, 3))
    return np.einsum("mi,mi->m", np.cross(a, b), c) / 6.0
