"""Materials by region: soft under folds, firmer on the back, firm elsewhere (Wang 2019 §5.5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, BoolArray, InputError, IntArray, artifacts
from handpipe.fem.elements import Material
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh
from handpipe.skeleton.rig import Rig

# Wang 2019 §5.5, in kPa: 12000, 6000 and 2000 N/m^2.
PALMAR, DORSAL, FOLD = (12.0, 0.495), (6.0, 0.495), (2.0, 0.45)
DEPTH = 3.0  # mm beneath the skin to which a fold is soft


@dataclass(frozen=True)
class Creases:
    """What a tissue with creases has beyond others: a material a tet, and where its skin folds.

    The material is Saint-Venant-Kirchhoff with the volume term.

    Parameters
    ----------
    young : array (m,)
        Young's moduli in kPa.
    poisson : array (m,)
        Poisson's ratios.
    folding : array (k,)
        Skin vertices where it folds.

    References
    ----------
    Wang 2019 §5.5.
    """

    young: Array
    poisson: Array
    folding: IntArray

    @property
    def material(self) -> Material:
        """The material of the elastic energy."""
        return Material(self.young, self.poisson, "stvk")

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {"young": self.young, "poisson": self.poisson, "folding": self.folding}

    @staticmethod
    def from_group(group: Mapping[str, Any], source: str | Path, count: int) -> Creases:
        """What `to_group` gave, of `count` tets; `InputError` names `source` where it is of others."""
        if not len(group["young"]) == len(group["poisson"]) == count:
            raise InputError(source, "creases", f"are not of {count} tets", artifacts.REBUILD)
        return Creases(group["young"], group["poisson"], group["folding"])


def creases_of(mesh: TetMesh, skin: Surface, folding: BoolArray, rig: Rig, dorsal: Array | None) -> Creases:
    """The material of each tet by its place.

    A tet is soft within 3 mm of skin that folds. Of the others, those that lie on the dorsal side of the
    nearest bone are half as stiff as the rest.

    Parameters
    ----------
    mesh : TetMesh
        Neutral tets in mm.
    skin : Surface
        Neutral skin in mm, n vertices.
    folding : array (n,) of bool
        Vertices where it folds.
    rig : Rig
        The bone rig.
    dorsal : array (3,), optional
        Direction from the palm to the back; None where no joint tells it.

    Returns
    -------
    Creases
        The materials.

    References
    ----------
    Wang 2019 §5.5.
    """
    centres = mesh.vertices[mesh.tets].mean(axis=1)
    depth, triangle, _ = Distance(skin).closest(centres)
    fold = folding[skin.triangles[triangle]].any(axis=1) & (depth < DEPTH)
    back = np.zeros(len(centres), dtype=bool) if dorsal is None else _on_the_back(centres, rig, dorsal)
    kinds = np.where(fold, 2, np.where(back, 1, 0))
    values = np.array([PALMAR, DORSAL, FOLD]).T[:, kinds]
    return Creases(values[0], values[1], np.flatnonzero(folding))


def _on_the_back(centres: Array, rig: Rig, dorsal: Array) -> BoolArray:
    """Which points (m,) lie on the dorsal side of the nearest bone."""
    found = [Distance(bone).closest(centres) for bone in rig.surfaces.values()]
    nearest = np.argmin([distances for distances, _, _ in found], axis=0)
    feet = np.choose(nearest[:, None], [places for _, _, places in found])
    above: BoolArray = (centres - feet) @ dorsal > 0
    return above
