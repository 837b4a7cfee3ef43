"""A hand's measures, taken on its surfaces as on a person."""

from __future__ import annotations

import numpy as np
import trimesh

from handpipe.anatomy.person import SubjectTemplate, lengths_of
from handpipe.core import Array
from handpipe.mesh.surfaces import Surface

HEIGHTS = np.linspace(-8.0, 4.0, 7)  # mm above the knuckles' middles, of an adult, at which breadth is tried
ADULT = 69.0  # mm: length of the third metacarpal of the hand that these heights are of


def hand_measures(hand: SubjectTemplate) -> dict[str, float]:
    """Lengths of the long bones, breadth and thickness at the knuckles.

    Parameters
    ----------
    hand : SubjectTemplate
        Right hand in neutral with bones, joints and skin: +x distal, +y radial, +z dorsal, in mm.

    Returns
    -------
    dict of str to float
        mm by bone; "breadth": the widest at the heads of metacarpals II and V, "thickness": at that of III.
    """
    assert hand.skin is not None
    found = lengths_of(hand)
    centres = {joint.name: joint.centre for joint in hand.joints}
    first, last = centres["MP2"], centres["MP5"]
    across, up = first - last, np.array([0.0, 0.0, 1.0])
    apart = float(np.linalg.norm(across))
    places = found["metacarpal3"] / ADULT * HEIGHTS[:, None] * up
    radial = _outwards(hand.skin, first + places, across / apart)
    ulnar = _outwards(hand.skin, last + places, -across / apart)
    middle = centres["MP3"][None]
    thickness = _outwards(hand.skin, middle, up) + _outwards(hand.skin, middle, -up)
    return {**found, "breadth": float(apart + (radial + ulnar).max()), "thickness": float(thickness[0])}


def _outwards(skin: Surface, points: Array, direction: Array) -> Array:
    """Mm (n,) from points (n, 3) inside a skin to where a direction (3,) first leaves it."""
    mesh = trimesh.Trimesh(skin.vertices, skin.triangles, process=False)
    places, rays, _ = mesh.ray.intersects_location(points, np.tile(direction, (len(points), 1)))
    along = (places - points[rays]) @ direction
    return np.array([along[rays == number].min() for number in range(len(points))])
