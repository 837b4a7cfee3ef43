"""From a measured person to a generated hand: its size, the lengths of its bones, its flesh."""

from __future__ import annotations

from functools import cache

import numpy as np

from handpipe.core import InputError
from handpipe.synthetic.family.measured_people import MEDIAN_MAN, PEOPLE
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.phantom_hand_bones import FINGERS, RAYS, frames, rays

# The median generated hand, whose bones are a median man's and whose flesh is its own, in mm.
BESIDE = 29.2  # of flesh beside the middles of the outer knuckles, both sides together
THICKNESS = 29.5  # at the knuckles
ROUNDS = 6  # of the search of a size: the knuckles' distance depends a little on it


@cache
def build_of(name: str) -> HandBuild:
    """The generated hand that has a measured person's proportions.

    Metacarpals are as long as the person's palm for the median man's, phalanges as the finger. Breadth and
    thickness at the knuckles are the person's.

    Parameters
    ----------
    name : str
        One of `PEOPLE`.

    Returns
    -------
    HandBuild
        Size, lengths of bones and flesh.

    Raises
    ------
    InputError
        For another name.
    """
    if name not in PEOPLE:
        problem = f"{name!r} is no measured person"
        raise InputError("dataset", "proportions", problem, f"Use one of {', '.join(PEOPLE)}")
    person = PEOPLE[name]
    palm, finger = person.palm / MEDIAN_MAN.palm, person.finger / MEDIAN_MAN.finger
    lengths = {
        f"{kind}{ray}": segment.length * (palm if kind == "metacarpal" else finger)
        for ray, segments in RAYS.items()
        for kind, segment in segments.items()
    }
    build = HandBuild(name, palm, lengths)
    for _ in range(ROUNDS):
        across = _knuckles(build)
        if person.thickness is None:
            size, flesh = person.breadth / (across + BESIDE), 1.0
        else:
            size = (person.breadth - BESIDE / THICKNESS * person.thickness) / across
            flesh = person.thickness / (THICKNESS * size)
        build = HandBuild(name, size, lengths, flesh)
    return build


def _knuckles(build: HandBuild) -> float:
    """Mm between the heads of metacarpals II and V, before the hand has its size."""
    placed, segments = frames(build), rays(build)
    first, last = (
        placed[f"metacarpal{ray}"](segments[ray]["metacarpal"].head()) for ray in (FINGERS[0], FINGERS[-1])
    )
    return float(np.linalg.norm(first - last))
