"""Bones that the skin hides in neutral: how far they come through it in a frame, and what keeps them in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray, Shape, Shapes
from handpipe.fem.contact import Contact
from handpipe.mesh.surfaces import BodyDistances, Distance, Surface, about
from handpipe.mesh.tets import mass_lumped

SPACING = 1.0  # mm between watched vertices: a cap of a bone that is 0.2 mm high is wider
COVER = 0.1  # mm that the skin keeps over a bone: as far as its sheets keep from one another
TOUCH = 1.0  # mm: a bone has no contact with skin farther above it, and none where skin is deeper in it
AROUND = 20.0  # mm from a bone in neutral within which the skin may touch it


class HiddenBones:
    """Vertices of bones inside the neutral skin, about one a millimetre, and the skin over bones.

    Parameters
    ----------
    skin : Surface
        The neutral skin, v vertices and t triangles.
    parents : mapping of str to str
        Parent of each bone but the root.
    """

    def __init__(self, skin: Surface, parents: Mapping[str, str] = MappingProxyType({})) -> None:
        self._skin, self._parents = skin, parents
        self._watched: dict[str, IntArray] = {}
        self._own: dict[str, IntArray] = {}
        self._distances = BodyDistances()
        count, triangles = len(skin.vertices), skin.triangles
        middles = sparse.csr_matrix(
            (np.full(triangles.size, 1 / 3), (np.repeat(np.arange(len(triangles)), 3), triangles.ravel())),
            shape=(len(triangles), count),
        )
        # Vertices and middles of triangles: between vertices alone a small bone would come through.
        self._places = sparse.vstack([sparse.identity(count), middles], format="csr")
        self._areas = np.concatenate([mass_lumped(skin.vertices, triangles), skin.triangle_areas()]) / 2

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

    def contact(
        self, skin: Surface, bones: Shapes, matrix: sparse.csr_matrix, stiffness: float
    ) -> Iterator[Contact]:
        """Contact of the skin with the bones beneath it: a plane for each place of it that is near a bone.

        Places that lie in a bone in neutral have none: at the cut end of a limb, and where the scan and the
        image disagree. Nor has the skin of other fingers, which the skin of this one keeps away, nor skin
        that lies deep in a bone, as where a guess has not come to rest: the nearest ways out part, and would
        tear it.

        Parameters
        ----------
        skin : Surface
            The skin as it is now.
        bones : Shapes
            The bones in the frame, by name.
        matrix : sparse matrix (v, n)
            Takes positions of the tissue to those of the skin.
        stiffness : float
            Stiffness in kPa/mm, per area of skin.

        Yields
        ------
        Contact
            For each bone that is near the skin.
        """
        if not bones:
            return
        places, own = self._places @ skin.vertices, self._own_places(bones)
        for name, shape in bones.items():
            bone = Surface(shape.vertices, shape.cells)
            near = own[name][about(places[own[name]], bone, TOUCH)]
            gaps, _, feet, normals = self._distances.to(name, shape.rest, bone).signed(places[near])
            touch = np.flatnonzero(gaps < TOUCH)
            if len(touch) and gaps.min() > -TOUCH:
                ids, planes = near[touch], feet[touch] + COVER * normals[touch]
                yield Contact(
                    self._places[ids] @ matrix, planes, normals[touch], stiffness * self._areas[ids]
                )

    def _of(self, name: str, bone: Shape) -> IntArray:
        """Ids of the watched vertices of a bone, found once."""
        if name not in self._watched:
            _, chosen = np.unique(np.floor(bone.rest / SPACING), axis=0, return_index=True)
            self._watched[name] = chosen[self._skin.contains(bone.rest[chosen])]
        return self._watched[name]

    def _own_places(self, bones: Shapes) -> dict[str, IntArray]:
        """Ids of the places of the skin that each bone may touch, found once.

        They lie outside of the bone in neutral, next to it or to a neighbour in the tree of bones.
        """
        if self._own.keys() != bones.keys():
            places = self._places @ self._skin.vertices
            signed = np.full((len(bones), len(places)), np.inf)
            for row, bone in zip(signed, bones.values(), strict=True):
                rest = Surface(bone.rest, bone.cells)
                around = about(places, rest, AROUND)
                row[around] = Distance(rest).signed(places[around])[0]
            nearest = np.array([*bones])[np.abs(signed).argmin(axis=0)]
            self._own = {}
            for name, row in zip(bones, signed, strict=True):
                beside = {name, self._parents.get(name), *(c for c, p in self._parents.items() if p == name)}
                mine = np.isin(nearest, [b for b in beside if b]) & (row > COVER) & (row < AROUND)
                self._own[name] = np.flatnonzero(mine)
        return self._own
