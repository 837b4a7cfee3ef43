"""Bones that the skin hides in neutral, and how far they come through it in a frame."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, IntArray, Shape, Shapes
from handpipe.mesh.surfaces import Distance, Surface

SPACING = 1.0  # mm between watched vertices: a cap of a bone that is 0.2 mm high is wider


class HiddenBones:
    """Vertices of bones inside the neutral skin, about one a millimetre.

    Parameters
    ----------
    skin : Surface
        The neutral skin.
    """

    def __init__(self, skin: Surface) -> None:
        self._skin = skin
        self._watched: dict[str, IntArray] = {}

    def outside(self, skin: Surface, bones: Shapes) -> float:
        """Distance in mm outside the skin of the farthest vertex that neutral skin hides; zero if none is.

        Parameters
        ----------
        skin : Surface
            The skin in the frame.
        bones : Shapes
            The bones in the frame, by name.

        Returns
        -------
        float
        """
        points = [shape.vertices[self._of(name, shape)] for name, shape in bones.items()]
        if not points:
            return 0.0
        together: Array = np.concatenate(points)
        out = together[~skin.contains(together)]
        return float(np.abs(Distance(skin).signed(out)[0]).max()) if len(out) else 0.0

    def _of(self, name: str, bone: Shape) -> IntArray:
        """Ids of the watched vertices of a bone, found once."""
        if name not in self._watched:
            _, chosen = np.unique(np.floor(bone.rest / SPACING), axis=0, return_index=True)
            self._watched[name] = chosen[self._skin.contains(bone.rest[chosen])]
        return self._watched[name]
