"""Draw the hands of measured people: python -m handpipe.develop.family_picture PICTURE.png.

Above their skin from the back, below their bones in it; one scale for all. No simulation: hands as generated.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image as images

from handpipe.anatomy.person import SubjectTemplate, scaled
from handpipe.core import Parser, atomic, reported
from handpipe.evaluation.rendering import Camera, Drawable, Image, render
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.family import PEOPLE, build_of
from handpipe.synthetic.template_hands import bare_hand

BONE_EDGE, SKIN_EDGE = 1.6, 2.8  # mm of the median hand
SIZE = (1500, 560)  # pixels of a row
APART = 12.0  # mm between hands
SKIN, BONE = (0.86, 0.66, 0.56), (0.93, 0.89, 0.78)  # colours in 0..1
SEEN_THROUGH = 0.25  # opacity of skin over bones
BACK, UP = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])  # direction of the view, and what is upwards


def hands() -> dict[str, SubjectTemplate]:
    """Bones and skin of each hand at its size, mirrored where it is the left one."""
    found = {}
    for name in PEOPLE:
        build = build_of(name)
        hand = scaled(bare_hand(BONE_EDGE, SKIN_EDGE, build), build.size)
        found[name] = hand.mirrored() if name == "left" else hand
    return found


def family_picture(people: Mapping[str, SubjectTemplate]) -> Image:
    """Rows of the hands, skin above and bones below, in the order of the mapping from left to right.

    Parameters
    ----------
    people : mapping of str to SubjectTemplate
        Hands with bones and skin in mm: +x distal, +z dorsal.
    """
    shifts, at = {}, 0.0
    for name, hand in people.items():
        assert hand.skin is not None
        low, high = hand.skin.vertices.min(axis=0), hand.skin.vertices.max(axis=0)
        # +y is on the left of a view from the back.
        shifts[name] = np.array([-low[0], at - high[1], 0.0])
        at -= high[1] - low[1] + APART

    def shifted(surface: Surface, name: str) -> Surface:
        return surface.moved(surface.vertices + shifts[name])

    skins = [shifted(hand.skin, name) for name, hand in people.items() if hand.skin is not None]
    bones = [shifted(bone, name) for name, hand in people.items() for bone in hand.bones.values()]
    camera = Camera.fit([skin.vertices for skin in skins], BACK, UP, SIZE)
    above = [Drawable(skin, SKIN, scattering=True) for skin in skins]
    below = [*(Drawable(b, BONE) for b in bones), *(Drawable(skin, SKIN, SEEN_THROUGH) for skin in skins)]
    return np.concatenate([render(above, camera, SIZE), render(below, camera, SIZE)])


def main(arguments: list[str] | None = None) -> int:
    """Write the picture and return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.family_picture", description=__doc__)
    parser.add_argument("picture", type=Path, help="PNG file")
    options = parser.parse_args(arguments)
    with reported() as failure, atomic(options.picture) as temporary:
        images.fromarray(family_picture(hands())).save(temporary, format="png", optimize=True)
    return failure.code


if __name__ == "__main__":
    raise SystemExit(main())
