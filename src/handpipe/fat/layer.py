"""The outermost layer: fat on all that lies below, or one soft tissue on bones; its outside is the skin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handpipe.fat.nails import from_vector
from handpipe.fat.tissue import Tissue
from handpipe.fem import plasticity
from handpipe.layers import Frame, Shape, Shapes
from handpipe.mesh.rigid import RigidTransform
from handpipe.skeleton.pose_space import PoseSpace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FatStrains:
    """What varies with pose: log-strains (N, m, 6) and nail corrections {nail: (N, 6)} at the example poses."""

    space: PoseSpace
    log_strains: Array
    nails: Mapping[str, Array]


class TissueLayer:
    """A tissue and, where fitted, its strains over poses. Named "fat" on all layers below, "skin" on bones alone."""

    def __init__(
        self, name: str, needs: tuple[str, ...], tissue: Tissue, strains: FatStrains | None = None
    ) -> None:
        self.name, self.needs, self.tissue, self.strains = name, needs, tissue, strains

    def plastic_strains(self, bones: Mapping[str, RigidTransform]) -> Array | None:
        """Strains (m, 6) of the fat in a pose, or None for none."""
        if self.strains is None:
            return None
        return plasticity.exp(self.strains.space.interpolate(self.strains.log_strains, bones))

    def rigid(self, bones: Mapping[str, RigidTransform]) -> dict[str, RigidTransform]:
        """Transforms of nails and the cut end in a pose."""
        transforms = {}
        for name, part in self.tissue.rigid.items():
            correction = RigidTransform.identity()
            if self.strains is not None and name in self.strains.nails:
                vector = self.strains.space.interpolate(self.strains.nails[name], bones)
                correction = from_vector(vector, self.tissue.skin.vertices[part.vertices].mean(axis=0))
            transforms[name] = bones[part.bone] @ correction
        return transforms

    def solve(self, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """Skin surface and tissue tets at equilibrium. Raises `ConvergenceError` where there is none."""
        tissue, bones = self.tissue, frame.bones
        x = tissue.solve(below, self.rigid(bones), self.plastic_strains(bones), tissue.pose(bones))
        skin = tissue.skin_matrix @ x
        return {
            "skin": Shape(tissue.skin.vertices, skin, tissue.skin.triangles),
            self.name + "_tets": Shape(
                tissue.mesh.vertices, x, tissue.mesh.tets, {"occupancy": tissue.occupancy}
            ),
        }
