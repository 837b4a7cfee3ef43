"""Where the surfaces of rigid bodies pass one another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from handpipe.core import Array, BoolArray, IntArray, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface


def gliding(
    vertices: Array,
    bones: Mapping[str, IntArray],
    surfaces: Mapping[str, Surface],
    joints: Iterable[tuple[str, str]],
    motions: Sequence[Mapping[str, RigidTransform]],
    reach: float,
) -> BoolArray:
    """Which vertices on bones another bone of their joint passes within reach, in any position.

    Parameters
    ----------
    vertices : array (n, 3)
        Vertices of a mesh in mm.
    bones : mapping of str to array (b,)
        Indices of the vertices on each bone.
    surfaces : mapping of str to Surface
        Bones at rest.
    joints : iterable of (str, str)
        Pairs of bones.
    motions : sequence of mapping of str to RigidTransform
        Positions of the bones, from rest.
    reach : float
        Distance in mm.

    Returns
    -------
    boolean array (n,)
    """
    distances = {name: Distance(surface) for name, surface in surfaces.items()}
    passed = np.zeros(len(vertices), dtype=bool)
    for pair in joints:
        for one, other in (pair, pair[::-1]):
            on = bones[one]
            for at in motions:
                seen = at[other].inverse()(at[one](vertices[on]))
                passed[on] |= distances[other].closest(seen)[0] < reach
    return passed
